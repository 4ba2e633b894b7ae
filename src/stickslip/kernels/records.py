"""Arrays of numbers, and records of them, whose fields kernels read and write by name,
such as ``motion.time``.
"""

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Counts = NDArray[np.int64]
Indices = NDArray[np.int32]
Mask = NDArray[np.bool_]
Records = NDArray[np.void]

Record: TypeAlias = Any
"""A record, or an array of records; numpy's stubs do not know fields."""


def record(*numbers: str, counts: str = "") -> Record:
    """Return a record type with number fields of these names (several in a text are
    separated by blanks), then integer fields `counts`.
    """
    fields = [(name, "f8") for words in numbers for name in words.split()]
    return np.dtype((np.record, fields + [(name, "i8") for name in counts.split()]))


def blank(kind: Record, size: int | tuple[int, ...] | None = None) -> Record:
    """Return a record of zeros, or an array of them of a size or shape, that kernels
    change in place.
    """
    made = np.zeros(size or 1, kind).view(np.recarray)
    return made[0] if size is None else made
