"""What `predict` returns: it prints, is a card and a page, draws itself, and converts
to plain numbers.
"""

from __future__ import annotations

import io
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, fields
from itertools import chain
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from stickslip.advise.findings import Findings, WaveFindings
from stickslip.advise.screen import (
    ARROWS,
    ASCII,
    MARKS,
    legend,
    paragraphs,
    place,
    strip,
    verdict,
)
from stickslip.advise.sections import (
    Section,
    changes_in_words,
    headline,
    headline_of_waves,
    quantity,
    sections,
    sections_of_waves,
)
from stickslip.answers import COLOURS, Answer, escaped, plain
from stickslip.errors import printable
from stickslip.model.rig import Rig

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.console import Console

_UNWRAPPED = 10_000  # columns: no sentence is as wide
_STRIP = 600.0  # width of the strip of speeds of a card, in its own units
# of the strip of speeds in characters: its cells, and the columns of a page where
# nobody knows them
_CELLS = 60
_COLUMNS = 80


class RigAnswer(Answer):
    """An answer about a rig: a headline, and the sections beneath it."""

    _picture: ClassVar[str]  # the function of `stickslip.plot` that draws it
    _derived: ClassVar[tuple[str, ...]]  # what `to_dict` gives beside the fields
    rig: Rig
    bands: Any
    speeds_searched: tuple[float, float]

    @property
    @abstractmethod
    def headline(self) -> str:
        """The motion at the rig's own speed, in a line."""

    @property
    @abstractmethod
    def sections(self) -> Sequence[Section]:
        """All sections, those without a sentence among them."""

    @property
    def motion(self) -> str:
        """The kind of motion at the rig's own speed, if a run shows it."""
        return ""

    @property
    def verdict(self) -> str:
        """The whole answer in one sentence."""
        rows = (
            section.rows
            for section in self.sections
            if section.name in ("here", "speeds")
        )
        return "; ".join([self.headline, *map(str, chain.from_iterable(rows))])

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
        """Return the answer in some twenty lines, or in full.

        Parameters
        ----------
        width : int, optional
            Columns to which sentences are wrapped; tables are kept whole.
        details : bool
            Whether all sections stand there, evidence and margins among them.
        bold : bool
            Whether titles are bold, and the strip of speeds is coloured, by the codes
            of a terminal.
        signs : bool
            Whether changes are written with arrows, and the signs of multiplication
            and division, which not every terminal has.
        """
        # slow to load
        from rich.console import Console

        page = io.StringIO()
        console = Console(
            file=page,
            width=_UNWRAPPED,  # no table is wrapped
            force_terminal=bold,
            color_system="auto" if bold else None,
            legacy_windows=False,
        )
        if details:
            self._print_details(console, width)
        else:
            self._print_screen(console, width, signs)
        return "\n".join(line.rstrip() for line in page.getvalue().splitlines())

    def _print_screen(self, console: Console, width: int | None, signs: bool) -> None:
        """Print verdict, strip of speeds, changes, and how sure it is."""
        # slow to load
        from rich.padding import Padding
        from rich.text import Text

        def print_line(line: str, style: str = "") -> None:
            words = Text(printable(line).strip(), style)
            indent = len(line) - len(line.lstrip())
            console.print(Padding(words, (0, 0, 0, indent)), width=width)

        found: Any = self
        speed = quantity(self.rig, self.rig.velocity, "velocity")
        print_line(f"{self.rig.name}, at {speed}", "bold")
        print_line(f"  {verdict(found)}")
        low, high = (
            quantity(self.rig, end, "velocity", 3) for end in self.speeds_searched
        )
        # beside them its ends, blanks, and two marks of now at most
        cells = (width or _COLUMNS) - len(f"  {low}  {high}||")
        if kinds := strip(found, min(max(cells, 1), _CELLS)):
            drawn = Text(f"  {low} ")
            for kind in kinds:
                colour = COLOURS.get(kind)
                drawn.append(MARKS[kind][0], f"black on {colour}" if colour else "bold")
            console.print(drawn.append(f" {high}"))
            print_line(f"  {legend(kinds)}")
        first, *rest = paragraphs(found, ARROWS if signs else ASCII)
        for paragraph in [first, *(each for each in rest if each.lines)]:
            if paragraph is not first:
                console.print()
            if paragraph.title:
                print_line(paragraph.title, "bold")
            for line in paragraph.lines:
                print_line(line)

    def _print_details(self, console: Console, width: int | None) -> None:
        """Print the headline and the sections, tables kept whole."""
        # slow to load
        from rich.table import Table
        from rich.text import Text

        def print_heading(title: str, rest: str) -> None:
            heading = Text.assemble((printable(title), "bold"), printable(rest))
            console.print(heading, width=width)

        print_heading(self.rig.name, f": {self.headline}")
        for section in self.sections:
            if not section.rows:
                continue
            console.print()
            if section.title:
                print_heading(section.title, section.note)
            sentences = isinstance(section.rows[0], str)
            grid = Table.grid(padding=(0, 1 if sentences else 2, 0, 0))
            for row in section.rows:
                mark = ["-"] if section.title else []
                cells = [*mark, row] if isinstance(row, str) else row
                grid.add_row(*(Text(printable(cell)) for cell in cells))
            console.print(grid, width=width if sentences else None)

    def html(self, **page: Any) -> str:
        """Return the headline, the strip of speeds and the sections as a card, or as a
        page with what else is on it.
        """
        # slow to load
        from jinja2 import Environment
        from markupsafe import Markup

        environment = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
        environment.filters["shown"] = lambda text: Markup(escaped(text))
        template = Path(__file__).with_name("answer.html").read_text(encoding="utf-8")
        ends = [quantity(self.rig, v, "velocity", 3) for v in self.speeds_searched]
        return environment.from_string(template).render(
            answer=self, colours=COLOURS, place=self._place, ends=ends, page=page
        )

    def _place(self, speed: float) -> float:
        """Place of a speed on the strip, whose axis is logarithmic."""
        found: Any = self
        return _STRIP * place(found, speed)

    def _repr_html_(self) -> str:
        return self.html()

    def to_dict(self) -> dict[str, Any]:
        """Return the answer as plain numbers, texts and lists, as JSON takes them;
        what is not finite is None.
        """
        # a mixin, whose subclasses are records
        own = [each.name for each in fields(self)]  # type: ignore[arg-type]
        names = ["headline", "verdict", "units", *self._derived, *own]
        found: dict[str, Any] = {"rig": self.rig.name, "velocity": self.rig.velocity}
        for name in names:
            if name not in ("rig", "recording"):
                found[name] = getattr(self, name)
        found["sentences"] = {
            section.name: section.rows for section in self.sections if section.rows
        }
        found["assumed"] = {key: str(item) for key, item in self.rig.assumed.items()}
        numbers: dict[str, Any] = plain(found)
        return numbers

    def plot(self) -> Figure:
        """Draw the answer: the motion at each speed; of a rigid slider also the
        force at its own, and the margins.
        """
        from stickslip import plot

        figure: Figure = getattr(plot, self._picture)(self)
        return figure


@dataclass(frozen=True, kw_only=True, repr=False)
class Prediction(Findings, RigAnswer):
    """Answer of `predict`: the `Findings`, every number in the rig's own units.

    It prints as its short text.
    """

    _picture = "prediction"
    _derived = (
        "at_speeds",
        "along_drive",
        "stiffness_margin",
        "smooth",
        "bistable",
        "frequency",
        "amplitude",
        "relative_amplitude",
    )

    headline = property(headline)
    sections = property(sections)
    motion = property(attrgetter("regime.kind"))
    changed = changes_in_words


@dataclass(frozen=True, kw_only=True, repr=False)
class ElasticPrediction(WaveFindings, RigAnswer):
    """Answer of `predict` for an elastic slider: the `WaveFindings`."""

    _picture = "waves"
    _derived = ("speeds",)

    headline = property(headline_of_waves)
    sections = property(sections_of_waves)
