"""Export of an interface to other programs: its dynamic stiffness as a linear system,
its friction in the forms of Modelica, Simscape, MuJoCo and LuGre, and its contacts as
an FMU.
"""

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import InputError, instance, printable, refused
from stickslip.io import files
from stickslip.model.parameters import VELOCITY
from stickslip.model.rig import USUAL_RANGE, Ends, Rig
from stickslip.model.units import engineering
from stickslip.sliding import kinetic_friction
from stickslip.sliding.rigid_motion import static_friction
from stickslip.structures import fmu
from stickslip.structures.statespace import state_space

Target = Literal["statespace", "modelica", "simscape", "mujoco", "lugre", "fmu"]
_BY_SPEED = ("modelica", "simscape", "lugre")
_SUFFIXES = {"statespace": (".mat", ".json"), "fmu": (".fmu",)}
_POINTS = 13  # number of speeds of a table
_LIMITS = "good for compensation and slow motion; predicts neither squeal nor hunting"


def export(
    rig: Rig,
    to: Target,
    path: str | os.PathLike[str] | None = None,
    *,
    speeds: Ends | None = None,
    poles: int | None = None,
) -> str:
    """Write the interface of a rig as the input of another program.

    Tables hold only steady sliding in a range of speeds. They are good for compensation
    and slow motion, but predict neither squeal nor hunting, as they have no memory.

    Parameters
    ----------
    rig : Rig
        A rig in SI units; in natural units, only its linear system can be written.
    to : {"statespace", "modelica", "simscape", "mujoco", "lugre", "fmu"}
        The linear system of `state_space`; ``SupportFriction``; ``Translational
        Friction``; ``frictionloss`` of a slide joint; ``sigma_0`` and ``g(v)``; or the
        contacts themselves as a functional mock-up unit (FMI 2.0, co-simulation), which
        works as `Element` and needs gcc.
    path : path, optional
        File to write; ``.mat`` or ``.json`` for a linear system, ``.fmu`` for a unit.
    speeds : (float, float), optional
        Range of speeds of a table, in the rig's unit or as texts with units; by default
        a factor 30 below and above the rig's velocity.
    poles : int, optional
        Number of poles of the linear system, by default 6.

    Returns
    -------
    str
        The content as text; for a linear system as JSON, for a unit its file name.

    Raises
    ------
    InputError
        If the target is unknown, the rig is in natural units where SI units are needed,
        its friction is not known, or the file cannot be written.

    Examples
    --------
    >>> from stickslip.structures import export
    >>> print(export(ss.read_rig("brake_pad"), "mujoco").splitlines()[-1])
    <joint type="slide" frictionloss="624"/>
    """
    instance("rig", rig, Rig, "a Rig")
    _check(rig, to, path, speeds, poles)
    if to == "statespace":
        system = state_space(rig, poles=6 if poles is None else poles)
        text = json.dumps(system.to_dict(), indent=2) + "\n"
        to_matlab = path is not None and Path(path).suffix == ".mat"
        content = system.mat() if to_matlab else text.encode()
    elif to == "fmu":
        text = str(path)
        content = fmu.unit_of(rig)
    else:
        text = _TEXTS[to](rig, _speeds(rig, speeds))
        content = text.encode()
    if path is not None:
        files.write(path, content)
    return text


def _check(
    rig: Rig,
    to: Any,
    path: Any,
    speeds: Any,
    poles: Any,
) -> None:
    """Raise `InputError`, before any work, for a rig or options that cannot be
    exported.
    """
    if not (isinstance(to, str) and to in get_args(Target)):
        raise refused("to", to, f"must be one of {', '.join(get_args(Target))}")
    if rig.scales is None and to != "statespace":
        raise InputError(
            f"to = {to!r}: needs SI units, and the rig is in natural units; give "
            "contact_strength and breaking_displacement with units, or use statespace"
        )
    if not rig.velocity > 0.0:
        raise InputError(
            f"drive.velocity = {rig.velocity:g}: must be above 0; an export describes "
            "steady sliding at it"
        )
    if speeds is not None and to not in _BY_SPEED:
        raise InputError(
            f"speeds: are for {', '.join(_BY_SPEED)}; {to} uses the rig's velocity, "
            "drive.velocity"
        )
    if poles is not None and to != "statespace":
        raise InputError(f"poles: are for statespace, not for {to}; leave them out")
    if path is None and to == "fmu":
        raise InputError("path: is missing; an FMU is a file: give NAME.fmu (-o)")
    if path is not None:
        files.target(path)
        known = _SUFFIXES.get(to)
        if known and Path(path).suffix not in known:
            raise InputError(f"{path}: {to} goes to a {' or '.join(known)} file")
    if to == "fmu":
        fmu.check(rig)


def _speeds(rig: Rig, speeds: Ends | None) -> Array:
    """Return the speeds of a table, in natural units."""
    usual = rig.natural.velocity / USUAL_RANGE, rig.natural.velocity * USUAL_RANGE
    ends = usual if speeds is None else rig.span(VELOCITY, speeds, "speeds")
    return np.geomspace(*ends, _POINTS)


def _friction(rig: Rig, speed: Any) -> Any:
    """Return friction in N at a speed or at several."""
    return rig.unit("force") * kinetic_friction(rig.interface, speed)


def _static(rig: Rig) -> float:
    return rig.unit("force") * static_friction(rig.interface)[0]


def _notes(rig: Rig, program: str, speeds: Array | None = None) -> list[str]:
    """Return the comments at the top of a file: where the friction holds, and where it
    fails.
    """
    ends = [rig.velocity] if speeds is None else speeds[[0, -1]] * rig.unit("velocity")
    range_of = " to ".join(engineering(float(v), "m/s") for v in ends)
    # a comment in XML must not contain two successive dashes
    name = printable(rig.name).replace("--", "- -")
    return [
        f"Friction of the contacts of {name}, for {program}, written by stickslip.",
        f"Steady sliding at {range_of}; {_LIMITS}.",
    ]


def _text(mark: str, notes: list[str], lines: list[str]) -> str:
    return "\n".join([*(f"{mark} {note}" for note in notes), *lines, ""])


def _modelica(rig: Rig, speeds: Array) -> str:
    force = _friction(rig, speeds)
    static = _static(rig)
    notes = _notes(rig, "Modelica", speeds)
    notes.append(
        "peak is the static friction over that of the slowest motion. A Brake takes "
        "mu_pos: these forces over fn_max*cgeo."
    )
    moving = zip(speeds * rig.unit("velocity"), force, strict=True)
    rows = [f"0, {force[0]:.6g}", *(f"{v:.6g}, {f:.6g}" for v, f in moving)]
    table = ";\n    ".join(rows)
    lines = [
        "Modelica.Mechanics.Translational.Components.SupportFriction friction(",
        f"  f_pos = [\n    {table}],",
        f"  peak = {max(static / float(force[0]), 1.0):.6g});",
    ]
    return _text("//", notes, lines)


def _simscape(rig: Rig, speeds: Array) -> str:
    slow = _friction(rig, speeds[0])
    notes = _notes(rig, "Simscape, block Translational Friction", speeds)
    notes.append("v_brk is the slowest speed of the range; below it the block creeps.")
    lines = [
        f"F_brk = {max(_static(rig), slow):.6g};  % N, static friction",
        f"F_C = {_friction(rig, rig.natural.velocity):.6g};"
        f"  % N, at {engineering(rig.velocity, 'm/s')}",
        f"v_brk = {speeds[0] * rig.unit('velocity'):.6g};  % m/s",
        "f = 0;  % N/(m/s)",
    ]
    return _text("%", notes, lines)


def _mujoco(rig: Rig, speeds: Array) -> str:  # noqa: ARG001
    force = _friction(rig, rig.natural.velocity)
    notes = "\n".join(f"     {note}" for note in _notes(rig, "MuJoCo"))
    hinge = "     On a hinge joint: this force times its lever arm, in N m."
    loss = f'<joint type="slide" frictionloss="{force:.5g}"/>'
    return f"<!--\n{notes}\n{hinge}\n-->\n{loss}\n"


def _lugre(rig: Rig, speeds: Array) -> str:
    notes = _notes(rig, "LuGre", speeds)
    notes += [
        "z' = v - sigma_0 |v| z/g(v), F = sigma_0 z; no sigma_1, no sigma_2.",
        f"sigma_0 = {rig.unit('stiffness'):.6g} N/m",
    ]
    moving = zip(speeds * rig.unit("velocity"), _friction(rig, speeds), strict=True)
    rows = [f"{v:.6g},{g:.6g}" for v, g in moving]
    return _text("#", notes, ["v (m/s),g (N)", *rows])


_TEXTS: dict[str, Callable[[Rig, Array], str]] = {
    "modelica": _modelica,
    "simscape": _simscape,
    "mujoco": _mujoco,
    "lugre": _lugre,
}
