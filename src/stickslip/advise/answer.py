"""The answers that `predict` returns: as text, as an HTML card or page, as a picture,
and as plain numbers.
"""

from __future__ import annotations

import io
import textwrap
from abc import abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from stickslip.advise import screen
from stickslip.advise.findings import Findings, WaveFindings
from stickslip.advise.screen import MARKS, Line
from stickslip.advise.sections import (
    ARROWS,
    ASCII,
    Motion,
    Section,
    changes_in_words,
    motion,
    motion_of_waves,
    sections,
    sections_of_waves,
)
from stickslip.answers import COLOURS, Answer, escaped, plain
from stickslip.errors import printable
from stickslip.model.rig import Rig

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_UNWRAPPED = 10_000  # columns: wider than any sentence
_STRIP = 600.0  # width of the strip of speeds on a card, in units of its SVG
_CELLS = 60  # most cells of the strip of speeds in characters
_COLUMNS = 80  # columns of a terminal, if their number is not known


def as_html(answer: Answer, **more: Any) -> str:
    """Return an answer with a headline and sections as a card, or as a page."""
    # slow to import
    from jinja2 import Environment
    from markupsafe import Markup

    environment = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
    environment.filters["shown"] = lambda text: Markup(escaped(text))
    template = Path(__file__).with_name("answer.html").read_text(encoding="utf-8")
    return environment.from_string(template).render(
        answer=answer, colours=COLOURS, **more
    )


class RigAnswer(Answer):
    """An answer about a rig: a headline, and the sections below it."""

    _picture: ClassVar[str]  # the function of `stickslip.plot` that draws it
    _derived: ClassVar[tuple[str, ...]]  # properties that `to_dict` adds to the fields
    _lines: ClassVar[Callable[..., Iterator[str | Line]]]  # below the strip of speeds
    rig: Rig
    bands: Any
    speeds_searched: tuple[float, float]

    @property
    @abstractmethod
    def headline_motion(self) -> Motion:
        """The motion at the rig's own speed."""

    @property
    @abstractmethod
    def sections(self) -> Sequence[Section]:
        """All sections, including empty ones."""

    @property
    def headline(self) -> str:
        """The motion at the rig's own speed, in one line."""
        return self.headline_motion.line

    @property
    def motion(self) -> str:
        """The kind of motion at the rig's own speed; empty without a run."""
        return ""

    @property
    def verdict(self) -> str:
        """The whole answer in one sentence."""
        rows = {section.name: section.rows for section in self.sections}
        return "; ".join(
            map(str, [self.headline, *rows.get("here", ()), *rows["speeds"]])
        )

    def __str__(self) -> str:
        return self.text()

    def text(
        self,
        width: int | None = None,
        *,
        details: bool = False,
        bold: bool = False,
        signs: bool = False,
    ) -> str:
        """Return the answer as text, in some twenty lines or in full.

        Parameters
        ----------
        width : int, optional
            Columns to which sentences are wrapped; tables are not wrapped.
        details : bool
            Whether to return all sections, with evidence and margins.
        bold : bool
            Whether titles are bold, and the strip of speeds is coloured, by terminal
            codes.
        signs : bool
            Whether changes are written with arrows and the signs of multiplication and
            division, which not every terminal can show.
        """
        lines = self._details() if details else self._screen(width, bold, signs)
        return "\n".join(_shown(line, width, bold) for line in lines)

    def _screen(
        self, width: int | None, bold: bool, signs: bool
    ) -> Iterator[str | Line]:
        """Yield the lines of the short text: verdict, strip of speeds, changes, and
        uncertainty.
        """
        yield Line("", screen.title(self.rig))
        yield f"  {screen.verdict(self.headline_motion)}"
        found: Any = self
        low, high = screen.ends(found)
        # leave room for blanks, and for two marks of the rig's own speeds
        cells = (width or _COLUMNS) - len(f"  {low}  {high}||")
        if kinds := screen.strip(found, min(max(cells, 1), _CELLS)):
            drawn = _coloured(kinds) if bold else "".join(MARKS[k][0] for k in kinds)
            yield Line(f"  {low} {drawn} {high}", whole=True)
            yield f"  {screen.legend(kinds)}"
        yield from self._lines(ARROWS if signs else ASCII)

    def _details(self) -> Iterator[str | Line]:
        """Yield the lines of the full text: the headline and all sections."""
        yield Line(f": {self.headline}", self.rig.name)
        for section in self.sections:
            if not section.rows:
                continue
            yield ""
            if section.title:
                yield Line(section.note, section.title)
            rows = [(row,) if isinstance(row, str) else row for row in section.rows]
            if len(rows[0]) == 1:
                mark = "- " if section.title else ""
                yield from (mark + row for (row,) in rows)
                continue
            wide = [max(map(len, column)) for column in zip(*rows, strict=True)]
            for row in rows:
                cells = map(str.ljust, map(printable, row), wide)
                yield Line("  ".join(cells), whole=True)

    @property
    def ends(self) -> list[str]:
        """The ends of the strip of speeds, in words."""
        found: Any = self
        return screen.ends_of_speeds(found)

    def html(self, **page: Any) -> str:
        """Return the headline, the strip of speeds and the sections as a card in HTML;
        with further contents `page`, as a page.
        """
        return as_html(self, place=self._place, page=page)

    def _place(self, speed: float) -> float:
        """Return the position of a speed on the strip of a card."""
        found: Any = self
        return _STRIP * screen.place(found, speed)

    def _repr_html_(self) -> str:
        return self.html()

    def to_dict(self) -> dict[str, Any]:
        """Return the answer as plain numbers, texts and lists for JSON; numbers that
        are not finite become None.
        """
        # the subclasses of this mixin are dataclasses
        own = [each.name for each in fields(self)]  # type: ignore[arg-type]
        names = [*own, *self._derived, "headline", "verdict", "units"]
        numbers: dict[str, Any] = plain(
            {
                **{name: getattr(self, name) for name in names if name != "recording"},
                "rig": self.rig.name,
                "velocity": self.rig.velocity,
                "sentences": {
                    each.name: each.rows for each in self.sections if each.rows
                },
                "assumed": {key: str(item) for key, item in self.rig.assumed.items()},
            }
        )
        return numbers

    def plot(self) -> Figure:
        """Draw the motion at each speed; for a rigid slider also the force at its own
        speed, and the margins.
        """
        from stickslip import plot

        figure: Figure = getattr(plot, self._picture)(self)
        return figure


def _shown(content: str | Line, width: int | None, bold: bool) -> str:
    """Return a line as it is printed: wrapped, unless it is to be kept whole, with a
    hanging indent.
    """
    line = Line(content) if isinstance(content, str) else content
    words = line.title + line.text
    if not line.whole:
        hang = len(words) - len(words.lstrip(" -"))
        words = textwrap.fill(
            printable(words),
            width or _UNWRAPPED,
            subsequent_indent=" " * hang,
            break_on_hyphens=False,
        )
    if bold and line.title:
        first, cut, rest = words.partition("\n")
        title = first[: len(line.title)]
        words = f"\033[1m{title}\033[0m{first[len(title) :]}{cut}{rest}"
    return words.rstrip()


def _coloured(kinds: Sequence[str]) -> str:
    """Return the cells of the strip of speeds with terminal codes for their colours."""
    # slow to import
    from rich.console import Console
    from rich.text import Text

    console = Console(file=(page := io.StringIO()), force_terminal=True)
    drawn = Text()
    for kind in kinds:
        colour = COLOURS.get(kind)
        drawn.append(MARKS[kind][0], f"black on {colour}" if colour else "bold")
    console.print(drawn, end="")
    return page.getvalue()


@dataclass(frozen=True, kw_only=True, repr=False)
class Prediction(Findings, RigAnswer):
    """Answer of `predict` for a rigid slider: its `Findings`, in the rig's own units.

    It prints as its short text.
    """

    _picture = "prediction"
    _lines = screen.lines
    _derived = (
        "at_speeds",
        "along_drive",
        "stiffness_margin",
        "smooth",
        "bistable",
        "frequency",
        "frequency_error",
        "cycles_per_time",
        "amplitude",
        "relative_amplitude",
    )

    headline_motion = property(motion)
    sections = property(sections)
    motion = property(attrgetter("regime.kind"))
    changed = changes_in_words


@dataclass(frozen=True, kw_only=True, repr=False)
class ElasticPrediction(WaveFindings, RigAnswer):
    """Answer of `predict` for an elastic slider: its `WaveFindings`, in the rig's own
    units.
    """

    _picture = "waves"
    _lines = screen.lines_of_waves
    _derived = ("speeds",)

    headline_motion = property(motion_of_waves)
    sections = property(sections_of_waves)
