"""Quantities in text: a number and a unit, ``"4 MN/m"``."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pint


@lru_cache(maxsize=1)
def _registry() -> pint.UnitRegistry[Any]:
    import pint

    return pint.UnitRegistry()


def read_quantity(text: str, unit: str, example: str) -> float:
    """Return a quantity in the unit asked for, or raise `ValueError` with the remedy."""
    import pint
    from pint.errors import PintError

    try:
        found: Any = _registry().Quantity(text)
        if found.dimensionless and unit:
            raise ValueError(f"has no unit; write it as in {example!r}")
        result = float(found.to(unit).magnitude)
    except pint.DimensionalityError:
        raise ValueError(f"is not in a unit of {unit!r}; write it as in {example!r}") from None
    except (PintError, AttributeError, TypeError, ValueError, ArithmeticError, AssertionError, SyntaxError) as error:
        if "unit" in str(error) and "write" in str(error):
            raise
        raise ValueError(f"cannot be read as a quantity; write it as in {example!r}") from None
    except Exception:  # pint lets errors of the tokenizer through
        raise ValueError(f"cannot be read as a quantity; write it as in {example!r}") from None
    return result
