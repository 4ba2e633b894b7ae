"""A figure of the paper from nothing to files: data, picture, and claims weighed on the data as written."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

from stickslip import plot
from stickslip.errors import InputError
from stickslip.io import datasets, files
from stickslip.paper.figure import Claim, Figure, Progress

Format = Literal["png", "pdf", "svg"]


@dataclass(frozen=True, kw_only=True)
class Reproduction:
    """A figure that was made.

    Attributes
    ----------
    figure : Figure
    data : Path
        The Dataset, as NetCDF.
    pictures : tuple of Path
    claims : tuple of Claim
    """

    figure: Figure
    data: Path
    pictures: tuple[Path, ...]
    claims: tuple[Claim, ...]

    @property
    def failed(self) -> tuple[Claim, ...]:
        """The claims that did not come out as expected."""
        return tuple(claim for claim in self.claims if not claim.ok)

    @property
    def ok(self) -> bool:
        """Whether every claim came out as expected."""
        return not self.failed

    def __str__(self) -> str:
        parts = [f"{self.figure.name}: {self.figure.title}. {self.figure.caption}\n"]
        parts += [f"{claim}\n" for claim in self.claims]
        parts += [*(f"picture: {picture}" for picture in self.pictures), f"data: {self.data}"]
        if self.failed:
            parts.append(f"{len(self.failed)} of {len(self.claims)} claims did not come out as expected")
        return "\n".join(parts)

    def to_dict(self) -> dict[str, object]:
        """Return what JSON can hold."""
        return {
            "figure": self.figure.name,
            "title": self.figure.title,
            "caption": self.figure.caption,
            "pictures": [str(picture) for picture in self.pictures],
            "data": str(self.data),
            "claims": [claim.plain() for claim in self.claims],
            "ok": self.ok,
        }


def places(
    figure: Figure, directory: str | os.PathLike[str], formats: Sequence[Format] = ("png",)
) -> tuple[Path, tuple[Path, ...]]:
    """Return where data and pictures of a figure go; the directory is made.

    Raises
    ------
    InputError
        If nothing can be written there, or a format is unknown.
    """
    folder = Path(directory)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made a directory ({error.strerror}); choose another place") from None
    for name in formats:
        if name not in get_args(Format):
            raise InputError(f"formats: {name!r} is unknown; choose from {', '.join(get_args(Format))}")
    data, pictures = folder / f"{figure.name}.nc", tuple(folder / f"{figure.name}.{name}" for name in formats)
    for place in (data, *pictures):
        files.target(place)
    return data, pictures


def reproduce(
    figure: Figure,
    directory: str | os.PathLike[str],
    *,
    formats: Sequence[Format] = ("png",),
    check: bool = True,
    quick: bool = False,
    progress: Progress | None = None,
) -> Reproduction:
    """Compute a figure, write data and pictures, and weigh the claims on the data read back from the file.

    Parameters
    ----------
    figure : Figure
    directory : path
        Where ``fig4.nc``, ``fig4.png`` ... go; made if it is not there.
    formats : sequence of {"png", "pdf", "svg"}
    check : bool
        Whether to weigh the claims.
    quick : bool
        Fewer points and contacts; the verdicts are the same.
    progress : callable, optional
        Called with the fraction of the work that is done.

    Raises
    ------
    InputError
        If nothing can be written there; before anything is computed.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> from stickslip.paper import FIGURES, reproduce
    >>> with TemporaryDirectory() as folder:
    ...     made = reproduce(FIGURES["fig2"], folder, formats=["svg"], quick=True)
    >>> made.ok, made.pictures[0].name
    (True, 'fig2.svg')
    """
    file, pictures = places(figure, directory, formats)
    data = datasets.load(datasets.save(figure.compute(progress, quick), file))
    drawn = figure.draw(data)
    for picture in pictures:
        plot.save(drawn, picture)
    return Reproduction(figure=figure, data=file, pictures=pictures, claims=figure.check(data) if check else ())
