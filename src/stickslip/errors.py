"""The error of wrong input, and the checks that raise it.

Each message names the place, the value found there, and what would be right, so that
the command line can print it unchanged.
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

# most characters of a message, whatever the user gave: 400 with what a terminal adds
LONGEST_MESSAGE = 380

SMALLEST, LARGEST = 1e-30, 1e30
"""Absolute values that a number may have, in any unit: its powers and ratios then stay
in the range of doubles.
"""


def one_line(message: str) -> str:
    """Return a message in one line; a long one is cut in the middle, as its place comes
    first and its remedy last.
    """
    end = LONGEST_MESSAGE // 3
    if len(message) > LONGEST_MESSAGE:
        message = f"{message[: LONGEST_MESSAGE - end - 5]} ... {message[-end:]}"
    return printable(" ".join(message.split()))


def printable(text: str) -> str:
    """Return a text without the characters that would control a terminal, such as
    control characters and direction marks: each is replaced by one sign.
    """
    return "".join(
        "\N{REPLACEMENT CHARACTER}" if category(c) in ("Cc", "Cf", "Zl", "Zp") else c
        for c in text
    )


class InputError(ValueError):
    """Input that cannot be used; the message says where it is, what is wrong, and how
    to correct it.

    Its `place` is the field of a record (``"Slider.mass"``) or the key of a file
    (``"interface.delay"``) with which the message begins, empty if there is no single
    one; `mistakes` are the single errors that it combines.
    """

    def __init__(
        self, message: str, place: str = "", mistakes: tuple[InputError, ...] = ()
    ) -> None:
        super().__init__(one_line(message))
        self.place = place
        self.mistakes = mistakes or (self,)

    def at(self, place: str) -> InputError:
        """Return the same error with another place, such as the key of a file instead
        of the field of a record.
        """
        message = str(self)
        if self.place and message.startswith(self.place):
            return InputError(place + message.removeprefix(self.place), place)
        return InputError(f"{place}: {message}", place)


_MOST_NAMED = 320  # after this many characters, further mistakes are only counted


def together(mistakes: Iterable[str]) -> str:
    """Return mistakes in one line, as many as fit in a message; the others are
    counted.
    """
    each = list(mistakes)
    named = 1 + sum(so_far <= _MOST_NAMED for so_far in accumulate(map(len, each)))
    more = len(each) - named
    return "; ".join(each[:named]) + (f"; and {more} more" if more > 0 else "")


class UndecidedError(RuntimeError):
    """A question that the evidence cannot decide; the message gives the evidence."""


LONGEST_SHOWN = 60  # most characters of a value in a message


def shortened(text: str) -> str:
    """Return a text, cut to the length that a message shows."""
    return text if len(text) <= LONGEST_SHOWN else f"{text[: LONGEST_SHOWN - 3]}..."


def shown(value: object) -> str:
    """Return the Python form of a value for a message, cut if it is long, large or
    deeply nested.
    """
    # a long text is cut first, as its form would take time
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
    """Return the error for a value that cannot be used at its place:
    ``"unit = 'x': must be ..."``.
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

    `place` is its name in the message (``"Slider.mass"``), `hint` its meaning, with its
    unit. Absolute values above 1e30 are refused, too, as are those below 1e-30, except
    0, unless the range includes negative numbers.
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
    # a signed number, such as a position or a velocity, may be arbitrarily near to 0
    signed = all(bound is None or bound < 0 for bound in (above, at_least))
    if (refusal := extreme(result)) and not (signed and abs(result) < SMALLEST):
        raise InputError(f"{place} = {result:g}: {refusal}{meaning}", place)
    return result


def _is_real(value: Any) -> TypeGuard[Real]:
    """Whether a value is a real number, which excludes bool, and numpy.timedelta64,
    which passes for an integer.
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
    """Return `value`, a number or an array of numbers, as an array; each number is
    checked as by `number`.
    """
    import numpy as np

    try:
        found = np.asarray(value)
    except (TypeError, ValueError):  # a Dataset; rows of different length
        found = np.empty(0, dtype=object)
    if found.dtype.kind not in "iuf":  # texts of digits are not accepted
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


def series(
    place: str, time: object, value: object
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return rising times and a value at each, as arrays; `place` names both."""
    import numpy as np

    t, values = (numbers(place, one) for one in (time, value))
    if t.ndim != 1 or t.shape != values.shape or t.size < 2 or np.diff(t).min() <= 0:
        raise InputError(
            f"{place}: shapes {t.shape} and {values.shape}: must be equal, (n,), the "
            "times rising"
        )
    return t, values


def sequence(place: str, value: Any, hint: str) -> tuple[Any, ...]:
    """Return the items of a list, a tuple or an array; a text is refused."""
    if not isinstance(value, (str, bytes, Mapping)):
        # raised if it cannot be iterated, or is an array without dimensions
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
    """Return why a number is refused as too large or too small; empty if it is not, or
    is infinite.
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
    # keep integers exact, as a float cannot hold every large seed
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
    """Raise `InputError` unless `value` is an instance of `kind`; a class is always
    refused, as it may pass for an instance of a Protocol.
    """
    if isinstance(value, type) or not isinstance(value, kind):
        raise refused(place, value, f"must be {hint}")


def dataset(place: str, value: object, hint: str) -> None:
    """Raise `InputError` unless `value` is a Dataset."""
    import xarray as xr

    instance(place, value, xr.Dataset, hint)
