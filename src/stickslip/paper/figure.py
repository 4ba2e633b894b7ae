"""A figure of the paper: data, a picture, claims that the data must satisfy, and the
files of all three.
"""

import json
import math
import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import Any, Literal, SupportsFloat

import xarray as xr

from stickslip import io, plot
from stickslip.answers import plain
from stickslip.errors import InputError
from stickslip.paper.kit import Picture, Progress
from stickslip.progress import heard

Format = Literal["png", "pdf", "svg"]
Verdict = Literal["reproduced", "reproduced under the stated reading", "not reproduced"]
_PRINTED: Verdict = "reproduced"
_READ: Verdict = "reproduced under the stated reading"
_NOT: Verdict = "not reproduced"


@dataclass(frozen=True, kw_only=True)
class Measured:
    """A number that a claim is based on, and the band in which it must lie: the settled
    number and its tolerance.
    """

    name: str
    value: float
    low: float = -math.inf  #: lower end of the band, included
    high: float = math.inf
    unit: str = ""  #: empty for a pure number

    @property
    def ok(self) -> bool:
        """Whether the value lies in the band; NaN does not."""
        return self.low <= self.value <= self.high

    def __str__(self) -> str:
        unit = f" {self.unit}" if self.unit else ""
        bounds = {"at least": self.low, "at most": self.high}
        band = [
            f"{words} {bound:.6g}"
            for words, bound in bounds.items()
            if math.isfinite(bound)
        ]
        if len(band) == 2:
            band = [
                (
                    f"{0.5 * (self.low + self.high):.6g} ± "
                    f"{0.5 * (self.high - self.low):.2g}"
                )
            ]
        text = f"{self.name} = {self.value:.6g}{unit} ({''.join(band) or 'no bound'}"
        return f"{text})" if self.ok else f"{text}: NOT MET)"


def between(
    name: str, value: SupportsFloat, low: float, high: float, unit: str = ""
) -> Measured:
    """Return a number that must lie in a band."""
    return Measured(
        name=name, value=float(value), low=float(low), high=float(high), unit=unit
    )


def near(
    name: str, value: SupportsFloat, exact: float, tolerance: float, unit: str = ""
) -> Measured:
    """Return a number that must be within a tolerance of the settled one."""
    return between(name, value, exact - tolerance, exact + tolerance, unit)


def at_most(name: str, value: SupportsFloat, bound: float, unit: str = "") -> Measured:
    """Return a number that must not exceed a bound."""
    return between(name, value, -math.inf, bound, unit)


def at_least(name: str, value: SupportsFloat, bound: float, unit: str = "") -> Measured:
    """Return a number that must reach a bound."""
    return between(name, value, bound, math.inf, unit)


def extremes(
    name: str, values: xr.DataArray, low: float, high: float, unit: str = ""
) -> list[Measured]:
    """Return the smallest and the largest of several numbers, which must all lie in a
    band.
    """
    found = {"smallest": values.min(skipna=False), "largest": values.max(skipna=False)}
    return [
        between(f"{name}, {which}", value, low, high, unit)
        for which, value in found.items()
    ]


@dataclass(frozen=True)
class Claim:
    """A claim of the paper, the numbers that it is based on, and our verdict."""

    #: in the list of the paper's claims that are checked, 1 to 18; None if it is not in
    #: the list
    number: int | None
    statement: str  #: the claim in our words
    measured: tuple[Measured, ...]
    _: KW_ONLY
    evidence: str  #: how it was checked
    #: whether it holds as printed; by default, if every number lies in its band
    printed: bool | None = None
    read: bool = True  #: whether it holds under the reading
    #: reading or range in which the claim holds; empty if it holds as printed
    reading: str = ""
    exact: str = ""  #: the correct statement, if the claim does not hold

    @property
    def verdict(self) -> Verdict:
        """The verdict by the data."""
        met = all(m.ok for m in self.measured)
        if met if self.printed is None else self.printed:
            return _PRINTED
        return _READ if self.reading and self.read and met else _NOT

    @property
    def settled(self) -> Verdict:
        """The verdict settled by an independent study of the model; any other verdict
        is an error of ours.
        """
        return _NOT if self.exact else _READ if self.reading else _PRINTED

    @property
    def ok(self) -> bool:
        """Whether the verdict is the settled one and every number lies in its band."""
        return self.verdict == self.settled and all(m.ok for m in self.measured)

    @property
    def title(self) -> str:
        """Number and statement in one line."""
        return (
            self.statement
            if self.number is None
            else f"claim {self.number}: {self.statement}"
        )

    def __str__(self) -> str:
        wrong = "" if self.verdict == self.settled else f" (expected: {self.settled})"
        expected = "as expected: " if self.verdict == self.settled == _NOT else ""
        lines = [
            f"{name}: {words}"
            for name in ("reading", "exact")
            if (words := getattr(self, name))
        ]
        lines = [
            f"{expected}{self.verdict}{wrong}",
            *lines,
            *map(str, self.measured),
            f"evidence: {self.evidence}",
        ]
        return "\n    ".join([f"{'ok' if self.ok else 'FAILED'}  {self.title}", *lines])

    def plain(self) -> dict[str, object]:
        """Return plain values for JSON; None stands for a missing bound and NaN."""
        names = (
            "number",
            "statement",
            "verdict",
            "settled",
            "reading",
            "exact",
            "evidence",
            "ok",
        )
        measured = [plain(m) | {"ok": m.ok} for m in self.measured]
        found: dict[str, object] = plain(
            {name: getattr(self, name) for name in names} | {"measured": measured}
        )
        return found


def claim_from(
    number: int | None, statement: str, *measured: Measured, **more: Any
) -> Claim:
    """Return a claim that is based on several numbers; other fields of `Claim` are
    given by name.
    """
    return Claim(number, statement, measured, **more)


@dataclass(frozen=True)
class Figure:
    """A figure of the paper: `compute` its data, `draw` them, and `check` the paper's
    claims with them.

    The first line of the docstring of its drawing is its title, the rest is the caption
    of its panels.
    """

    name: str  #: such as ``"fig4"``
    height: float  #: in inches
    data: Callable[[Progress, bool], xr.Dataset]
    claims: Callable[[xr.Dataset], Iterable[Claim]]
    drawing: Callable[[Picture, xr.Dataset], None]

    @property
    def title(self) -> str:
        """Title of the figure."""
        return str(self.drawing.__doc__).partition("\n\n")[0].removesuffix(".")

    @property
    def caption(self) -> str:
        """Description of the panels."""
        return " ".join(str(self.drawing.__doc__).split("\n\n")[1].split())

    def compute(
        self, progress: Progress | None = None, quick: bool = False
    ) -> xr.Dataset:
        """Compute the data of the figure; `quick` data are coarser, for tests, and give
        the same verdicts.

        `progress` is called with the completed fraction of the work.
        `stickslip.io.datasets.save` writes the data.
        """
        report = heard(progress)
        data = self.data(report, quick)
        report(1.0)
        arguments = {"figure": self.name} | ({"quick": True} if quick else {})
        return data.assign_attrs(
            title=f"{self.name}: {self.title}",
            caption=self.caption,
            provenance=io.provenance("paper", arguments),
        )

    def draw(self, data: xr.Dataset) -> Picture:
        """Draw the data from `compute`; `stickslip.plot.save` writes the picture."""
        self._check(data)
        with plot.house_style():
            picture = plot.new_figure(plot.PAGE, self.height)
            self.drawing(picture, data)
        return picture

    def check(self, data: xr.Dataset) -> tuple[Claim, ...]:
        """Check the claims of the paper with the data from `compute`."""
        self._check(data)
        return tuple(self.claims(data))

    def _check(self, data: xr.Dataset) -> None:
        made_by = io.read_provenance(data)
        if (
            made_by["call"] != "paper"
            or made_by["arguments"].get("figure") != self.name
        ):
            raise InputError(
                f"{self.name}: these are other data (made by "
                f"{json.dumps(made_by['arguments'])[:80]})"
            )


@dataclass(frozen=True, kw_only=True)
class Reproduction:
    """A figure that was computed and drawn."""

    figure: Figure
    data: Path  #: the Dataset, as NetCDF
    pictures: tuple[Path, ...]
    claims: tuple[Claim, ...]

    @property
    def ok(self) -> bool:
        """Whether every claim has the expected verdict."""
        return all(claim.ok for claim in self.claims)

    def __str__(self) -> str:
        parts = [
            f"{self.figure.name}: {self.figure.title}. {self.figure.caption}\n",
            *(f"{claim}\n" for claim in self.claims),
            *(f"picture: {picture}" for picture in self.pictures),
            f"data: {self.data}",
        ]
        if failed := sum(not claim.ok for claim in self.claims):
            parts.append(
                f"{failed} of {len(self.claims)} claims did not come out as expected"
            )
        return "\n".join(parts)

    def to_dict(self) -> dict[str, object]:
        """Return plain values for JSON."""
        return {
            "figure": self.figure.name,
            "title": self.figure.title,
            "caption": self.figure.caption,
            "pictures": list(map(str, self.pictures)),
            "data": str(self.data),
            "claims": [claim.plain() for claim in self.claims],
            "ok": self.ok,
        }


def places(
    figure: Figure,
    directory: str | os.PathLike[str],
    formats: Sequence[Format] = ("png",),
) -> tuple[Path, tuple[Path, ...]]:
    """Return the paths of the data and the pictures of a figure; the directory is
    created, or `InputError` is raised.
    """
    folder = Path(directory)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"{folder}: cannot be made a directory ({error.strerror}); choose another "
            "place"
        ) from None
    data, *pictures = (
        folder / f"{figure.name}.{suffix}" for suffix in ("nc", *formats)
    )
    for place in (data, *pictures):
        io.target(place)
    for picture in pictures:
        plot.format_of(picture)
    return data, tuple(pictures)


def reproduce(
    figure: Figure,
    directory: str | os.PathLike[str],
    *,
    formats: Sequence[Format] = ("png",),
    check: bool = True,
    quick: bool = False,
    progress: Progress | None = None,
) -> Reproduction:
    """Compute a figure, write data and pictures, and check the claims with the data
    read back from the file.

    Raises `InputError`, before anything is computed, if files cannot be written there.

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
    data = io.load(io.save(figure.compute(progress, quick), file))
    drawn = figure.draw(data)
    for picture in pictures:
        plot.save(drawn, picture)
    return Reproduction(
        figure=figure,
        data=file,
        pictures=pictures,
        claims=figure.check(data) if check else (),
    )
