"""Arrays for a screen: thinned to its width, and packed."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Plain = dict[str, Any]


def packed(values: NDArray[Any], kind: str = "f4") -> Plain:
    """An array as plotly.js takes it without parsing numbers."""
    return {"dtype": kind, "bdata": base64.b64encode(values.astype(f"<{kind}").tobytes()).decode()}


def envelope(x: Array, y: Array, width: int) -> tuple[Array, Array]:
    """Thin out a line to a screen's width: smallest and largest value of each pixel, in their order."""
    group = y.size // width
    if group < 3:
        return x, y
    whole = y.size // group * group
    blocks = y[:whole].reshape(-1, group)
    first = np.arange(0, whole, group)
    ends = np.stack([first + blocks.argmin(axis=1), first + blocks.argmax(axis=1)], axis=1)
    kept = np.unique(np.concatenate([[0], ends.ravel(), np.arange(whole, y.size), [y.size - 1]]))
    return x[kept], y[kept]


def along_path(x: Array, y: Array, count: int = 1_200) -> tuple[Array, Array]:
    """Thin out a curve in the plane: about as many points, evenly along its path, so that fast parts keep theirs."""
    if x.size <= count:
        return x, y
    scales = [float(np.ptp(values)) or 1.0 for values in (x, y)]
    way = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x) / scales[0], np.diff(y) / scales[1]))])
    kept = np.unique(np.searchsorted(way, np.linspace(0.0, way[-1], count)).clip(0, x.size - 1))
    return x[kept], y[kept]
