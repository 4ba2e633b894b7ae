"""``stickslip export``: the interface of a rig as the input of another program."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from stickslip.errors import whole
from stickslip.io.settings import read_rig_with
from stickslip.model.quantities import read_value
from stickslip.structures.exports import Target
from stickslip.structures.exports import export as write_export


def export(
    rig: Path,
    *,
    to: Target,
    output: Annotated[Path | None, Parameter(alias="-o")] = None,
    speeds: Annotated[tuple[str, str] | None, Parameter(negative="")] = None,
    poles: str | None = None,
    settings: Annotated[
        tuple[str, ...],
        Parameter(name="--set", negative="", consume_multiple=False),
    ] = (),
) -> None:
    """Write the interface of a rig as the input of another program.

    Parameters
    ----------
    rig
        A rig file in TOML, or the name of an example: `stickslip new` lists them.
    to
        A linear system of the dynamic stiffness (statespace: .mat, .json), friction in
        slow motion (modelica, simscape, mujoco, lugre), or the contacts themselves
        (fmu).
    output
        Write to a file; by default the text is printed.
    speeds
        Range of speeds of a table: '1 mm/s' '1 m/s'.
    poles
        Number of poles of the linear system: even, by default 6.
    settings
        A key of the rig file and its value, drive.velocity="2 mm/s"; may be given
        again.
    """
    count = None
    if poles is not None:
        given = read_value("--poles", poles, "1", "6", bare=True)
        count = whole("--poles", given, at_least=2, hint="even")
    text = write_export(
        read_rig_with(rig, settings),
        to,
        output,
        speeds=speeds,
        poles=count,
    )
    print(text if output is None else f"{to}: {output}\n", end="")
