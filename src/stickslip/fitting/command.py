"""The command `stickslip fit`: a measured trace in, a rig file with intervals out."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from stickslip.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable

    import xarray as xr

    from stickslip.fitting.fits import Fit


def fit_file(
    trace: xr.Dataset,
    *,
    stiffness: str | None,
    speed: str | None,
    mass: str | None,
    load: str | None,
    speeds: Path | None,
    holds: Path | None,
    smallest: float | None,
    after: float | None,
    output: Path | None,
    plot: Path | None,
    name: str,
    progress: Callable[[float], None],
) -> tuple[Fit, list[tuple[str, Path]]]:
    """Fit a trace as the command line asks; return the fit, and what was written where."""
    from stickslip.fitting.fits import fit
    from stickslip.io import files
    from stickslip.io.rig_files import to_toml

    known = {"stiffness": stiffness, "speed": speed, "mass": mass, "load": load}
    given = {key: value for key, value in known.items() if value is not None}
    if output is not None and stiffness is None:
        raise InputError(
            f"-o {output}: a rig needs the stiffness of the driving spring, without which a force trace tells no "
            "length; give --stiffness '350 N/m'"
        )
    found = fit(
        trace,
        known=given,
        smallest=smallest,
        after=after,
        speeds=_pairs(speeds),
        holds=_pairs(holds),
        progress=progress,
    )
    written = []
    if output is not None:
        files.write(output, to_toml(found.rig(name=name)).encode())
        written.append(("rig", output))
    if plot is not None:
        from stickslip import plot as drawing

        drawing.save(found.plot(), plot)
        written.append(("picture", plot))
    return found, written


_NUMBER = re.compile(r"[-+]?\d*[.]?\d+.*")
"""What begins as a number does: a line of names has none."""


def _pairs(path: Path | None) -> tuple[tuple[object, object], ...]:
    """Two columns of a text file: a speed in m/s or a time in s, and a force in N."""
    if path is None:
        return ()
    from stickslip.io import files

    rows: list[tuple[object, object]] = []
    text = files.read(path, "table of two columns", largest=1_000_000).decode("utf-8", "replace")
    for at, line in enumerate(text.splitlines(), start=1):
        line = line.split("#")[0].strip()
        heading = not any(_NUMBER.fullmatch(cell) for cell in re.split(r"[\s,;]+", line))
        if not line or (heading and not rows):
            continue
        try:
            if re.search(r"\d,\d.*[\s;]", line):  # a decimal comma
                raise ValueError
            first, second = (float(cell) for cell in re.split(r"\s*[,;]\s*|\s+", line))
        except ValueError:
            raise InputError(
                f"{path}: line {at}: {line[:60]!r}: must be two numbers without units, with decimal points, such as "
                "'0.001 12.5'"
            ) from None
        rows.append((first, second))
    if not rows:
        raise InputError(f"{path}: holds no rows of two numbers, such as '0.001 12.5'")
    return tuple(rows)
