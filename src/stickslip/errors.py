"""One error for every wrong input, and the checks that raise it.

Each message names the place, the value found there and what would be right, so that the
command line can print it as it is.
"""

from __future__ import annotations

import math
import reprlib
from collections.abc import Iterable, Mapping
from contextlib import suppress
from itertools import accumulate
from numbers import Integral, Real
from operator import ge, gt, le, lt
from types import UnionType
from typing import TYPE_CHECKING, Any, TypeGuard
from unicodedata import category

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

# characters of a message, whatever the user gave: a line of 400 on the terminal
LONGEST_MESSAGE = 380

SMALLEST, LARGEST = 1e-30, 1e30
"""Sizes that a number may have, in any unit: its powers and ratios then stay within
what a double can hold.
"""


def one_line(message: str) -> str:
    """Return a message in one line, cut in the middle if it is long: its place
    stands first, its remedy last.
    """
    end = LONGEST_MESSAGE // 3
    if len(message) > LONGEST_MESSAGE:
        message = f"{message[: LONGEST_MESSAGE - end - 5]} ... {message[-end:]}"
    return printable(" ".join(message.split()))


def printable(text: str) -> str:
    """Return a text with a sign in place of characters that would steer a terminal:
    control characters, marks of direction.
    """
    return "".join(
        "\N{REPLACEMENT CHARACTER}" if category(c) in ("Cc", "Cf", "Zl", "Zp") else c
        for c in text
    )


class InputError(ValueError):
    """Input that cannot be used; the message says where, what and how to put it right.

    Its `place` is the field of a record (``"Slider.mass"``) or the key of a file
    (``"interface.delay"``) that the message begins with, empty if there is no single
    one; its `mistakes` are the single errors of one of several.
    """

    def __init__(
        self, message: str, place: str = "", mistakes: tuple[InputError, ...] = ()
    ) -> None:
        super().__init__(one_line(message))
        self.place = place
        self.mistakes = mistakes or (self,)

    def at(self, place: str) -> InputError:
        """Return the same error at another place: the key of a file in place of the
        field of a record.
        """
        message = str(self)
        if self.place and message.startswith(self.place):
            return InputError(place + message.removeprefix(self.place), place)
        return InputError(f"{place}: {message}", place)


_MOST_NAMED = 320  # characters of mistakes after which the others are only counted


def together(mistakes: Iterable[str]) -> str:
    """Return mistakes in one line, as far as a message reaches; the others are
    counted.
    """
    each = list(mistakes)
    named = 1 + sum(so_far <= _MOST_NAMED for so_far in accumulate(map(len, each)))
    more = len(each) - named
    return "; ".join(each[:named]) + (f"; and {more} more" if more > 0 else "")


class UndecidedError(RuntimeError):
    """The question has no answer on the evidence at hand; the message gives the
    evidence.
    """


LONGEST_SHOWN = 60  # characters of a value that a message shows


def shortened(text: str) -> str:
    """Return a text as far as a message shows it."""
    return text if len(text) <= LONGEST_SHOWN else f"{text[: LONGEST_SHOWN - 3]}..."


def shown(value: object) -> str:
    """Return a value as a message shows it: as in Python, cut where it is long,
    large or deep.
    """
    # a long one is cut before it is turned into its form in Python
    if isinstance(value, str):
        return (
            shortened(repr(value[:LONGEST_SHOWN]))
            if len(value) <= LONGEST_SHOWN
            else f"{value[:40]!r}..."
        )
    if isinstance(value, int) and abs(value) >= 10**LONGEST_SHOWN:
        return (
            "an integer of about "
            f"{math.floor(value.bit_length() * math.log10(2)) + 1} digits"
        )
    try:
        return shortened(reprlib.repr(value))
    except Exception:  # a value may hold anything
        return f"a {type(value).__name__}"


def refused(place: str, value: object, words: str) -> InputError:
    """Return the error of a value that cannot be used at its place: ``"unit = 'x': must
    be ..."``.
    """
    return InputError(f"{place} = {shown(value)}: {words}", place)


def number(
    place: str,
    value: object,
    *,
    above: float | None = None,
    at_least: float | None = None,
    below: float | None = None,
    at_most: float | None = None,
    infinite: bool = False,
    hint: str = "",
) -> float:
    """Return `value` as a float if it is a real number in the range, else raise
    `InputError`.

    `place` is where it stands (``"Slider.mass"``), `hint` what it means, with its
    unit. Refused, too, is a size beyond 1e30, and one below 1e-30 of a number that
    is neither 0 nor may be negative.
    """
    every = (
        ("above", above, gt),
        ("at least", at_least, ge),
        ("below", below, lt),
        ("at most", at_most, le),
    )
    bounds = [(word, bound, holds) for word, bound, holds in every if bound is not None]
    meaning = f" ({hint})" if hint else ""
    wanted = " and".join(f" {word} {bound:g}" for word, bound, _ in bounds) + meaning
    try:
        # minus zero becomes zero: equal numbers look alike
        result = float(value) + 0.0 if _is_real(value) else None
    except OverflowError:
        result = None
    if result is None:
        raise refused(place, value, f"must be a number{wanted}")
    finite = math.isfinite(result) or (infinite and math.isinf(result))
    if not (finite and all(holds(result, bound) for _, bound, holds in bounds)):
        raise InputError(
            (
                f"{place} = {result:g}: must be a "
                f"{'' if infinite else 'finite '}number{wanted}"
            ),
            place,
        )
    # a place or a speed may be next to 0
    signed = all(bound is None or bound < 0 for bound in (above, at_least))
    if (refusal := extreme(result)) and not (signed and abs(result) < SMALLEST):
        raise InputError(f"{place} = {result:g}: {refusal}{meaning}", place)
    return result


def _is_real(value: Any) -> TypeGuard[Real]:
    """Whether a value is a real number: no truth value, and no numpy.timedelta64,
    which passes for a whole number.
    """
    if (
        isinstance(value, bool)
        or getattr(getattr(value, "dtype", None), "kind", "") == "m"
    ):
        return False
    return isinstance(value, Real)


def numbers(
    place: str,
    value: object,
    *,
    above: float | None = None,
    at_least: float | None = None,
    hint: str = "",
) -> NDArray[np.float64]:
    """Return `value`, a number or an array of numbers, as an array; each is checked
    as by `number`.
    """
    import numpy as np

    try:
        found = np.asarray(value)
    except (TypeError, ValueError):  # a Dataset; rows of different length
        found = np.empty(0, dtype=object)
    if found.dtype.kind not in "iuf":  # texts of digits are no numbers
        meaning = f" ({hint})" if hint else ""
        raise refused(place, value, f"must be a number or an array of numbers{meaning}")
    if found.size == 0:
        raise InputError(f"{place}: is empty; give at least one number", place)
    result = np.asarray(found, dtype=float)
    for worst in {
        float(result.min()),
        float(result.max()),
        float(np.abs(result[result != 0]).min(initial=1.0)),
    }:
        number(place, worst, above=above, at_least=at_least, hint=hint)
    return result


def sequence(place: str, value: Any, hint: str) -> tuple[Any, ...]:
    """Return the items of a list, a tuple or an array, not the letters of a text."""
    if not isinstance(value, (str, bytes, Mapping)):
        # nothing to go through, or an array without dimensions
        with suppress(TypeError):
            return tuple(value)
    raise refused(place, value, f"must be {hint}")


def pair(place: str, value: Any, hint: str) -> tuple[Any, Any]:
    """Return the two items of a list, a tuple or an array."""
    found = sequence(place, value, hint)
    if len(found) != 2:
        raise refused(place, value, f"must be {hint}")
    return found[0], found[1]


def extreme(value: float) -> str:
    """Return why the size of a number is refused; empty if it is not, or if it is
    infinite.
    """
    if value == 0 or SMALLEST <= abs(value) <= LARGEST or math.isinf(value):
        return ""
    return f"must be between {SMALLEST:g} and {LARGEST:g} in size, or 0"


def whole(
    place: str,
    value: object,
    *,
    at_least: float,
    at_most: float | None = None,
    hint: str = "",
) -> int:
    """Return `value` as an int if it is a whole number in the range, else raise
    `InputError`.
    """
    # A float does not hold every large seed.
    if _is_real(value) and isinstance(value, Integral):
        exact = int(value)
        if exact >= at_least and (at_most is None or exact <= at_most):
            return exact
    result = number(place, value, at_least=at_least, at_most=at_most, hint=hint)
    if result != int(result):
        raise InputError(
            f"{place} = {result:g}: must be a whole number"
            + (f" ({hint})" if hint else ""),
            place,
        )
    return int(result)


def instance(
    place: str, value: object, kind: type | UnionType | tuple[type, ...], hint: str
) -> None:
    """Raise `InputError` unless `value` is of the kind asked for; a class is refused
    (a Protocol would take it).
    """
    if isinstance(value, type) or not isinstance(value, kind):
        raise refused(place, value, f"must be {hint}")
