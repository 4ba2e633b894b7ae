"""Arrays of numbers, as types, and labelled for a Dataset."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complexfloating[Any, Any]]
Range = tuple[float, float]
"""The ends of a range, or of a stretch of time."""
Nodes = tuple[Array, Array]
"""Nodes and weights of a quadrature."""
Labelled = tuple[str | tuple[str, ...], NDArray[Any], dict[str, Any]]
"""A variable for a Dataset: its dimensions, values and attributes."""


def labelled(
    name: str, dims: str | tuple[str, ...], values: ArrayLike, units: str
) -> Labelled:
    """Return a variable with its units and its long name, for a Dataset."""
    return dims, np.asarray(values), {"units": units, "long_name": name}


def labels(table: str) -> dict[str, dict[str, str]]:
    """Return unit and long name of variables, by rows ``name | unit | long name``."""
    rows = (line.split(" | ") for line in table.strip().split("\n"))
    return {name: {"units": unit, "long_name": words} for name, unit, words in rows}


def units_of(variable: xr.DataArray | xr.Variable | None) -> str:
    """Return the unit of a variable; empty where it has none, or there is no such."""
    return "" if variable is None else str(variable.attrs.get("units", ""))
