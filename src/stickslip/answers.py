"""The base class of all answers: each prints as a short text, shows as a card in a
notebook, and converts to plain numbers.
"""

import html
import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

COLOURS = {
    "smooth sliding": "#DDEBF3",
    "sustained oscillation": "#E69F00",
    "stick-slip": "#0072B2",
    "unstable": "#BFBFBF",
    "stable": "#FFFFFF",
}
"""Colours of the kinds of motion in all pictures: the darker, the worse for a machine.
"""
_LINE = "#8888"  # visible on light and dark pages, like the colour of the text
_CARD = (
    f"border:1px solid {_LINE};border-radius:6px;padding:.5em "
    ".9em;max-width:56em;overflow-x:auto"
)


class Answer:
    """Base of the records that answer a question; their ``__str__`` is the text."""

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str:
        title, *lines = str(self).splitlines()
        return card(
            title,
            table(re.split(" {2,}", line.strip()) for line in lines),
            str(getattr(self, "kind", "")),
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the answer as plain numbers, texts and lists for JSON; NaN and
        infinity become None.
        """
        found: dict[str, Any] = plain(self)
        return found


def card(title: str, content: str, motion: str = "") -> str:
    """Return an answer as HTML for a notebook: a title, the content below it, and a
    left border in the colour of a motion.
    """
    edge = f"border-left:5px solid {COLOURS.get(motion, _LINE)}"
    return (
        f'<div style="{_CARD};{edge}"><div '
        f'style="font-size:1.1em"><b>{escaped(title)}</b></div>{content}</div>'
    )


def table(rows: Iterable[str | Sequence[str]]) -> str:
    """Return rows of texts as an HTML table; a single text spans all columns."""
    given = [[row] if isinstance(row, str) else list(row) for row in rows]
    look = f"text-align:left;padding:.15em 1em .15em 0;border-bottom:1px solid {_LINE}"
    wide = max(map(len, given), default=1)
    cell = f'<td style="{look}"'
    lines = [
        "".join(
            f"{cell} colspan={1 if row[1:] else wide}>{escaped(each)}</td>"
            for each in row
        )
        for row in given
    ]
    return (
        (
            "<table "
            f"style='border-collapse:collapse'><tr>{'</tr><tr>'.join(lines)}</tr></table>"
        )
        if lines
        else ""
    )


def with_micro(text: str) -> str:
    """Return a text with the micro sign in its units.

    Examples
    --------
    >>> with_micro("2 um, as usual")
    '2 µm, as usual'
    """
    return re.sub(r"(?<= )u(?=[msNg]\b)", "\N{MICRO SIGN}", text)


def escaped(text: str) -> str:
    """Return a text escaped for HTML, with the micro sign in its units."""
    return html.escape(with_micro(text))


def plain(value: Any) -> Any:
    """Return a record, mapping, sequence, array or value as plain JSON values; NaN and
    infinity become None.

    For a field of a record that has an error, ``NAME_error`` is added.
    """
    if is_dataclass(value) and not isinstance(value, type):
        held = {field.name: getattr(value, field.name) for field in fields(value)}
        errors = {
            f"{name}_error": each.error
            for name, each in held.items()
            if hasattr(each, "error")
        }
        return {name: plain(each) for name, each in (held | errors).items()}
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, complex):
        return {"real": plain(value.real), "imag": plain(value.imag)}
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, (bool, int, str)):
        return value
    return plain(value.tolist()) if hasattr(value, "tolist") else str(value)
