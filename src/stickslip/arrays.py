"""Types of arrays, and labelled variables for a Dataset."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complexfloating[Any, Any]]
Range = tuple[float, float]
"""The ends of a range of numbers or of times."""
Nodes = tuple[Array, Array]
"""Nodes and weights of a quadrature."""
Labelled = tuple[str | tuple[str, ...], NDArray[Any], dict[str, Any]]
"""A variable for a Dataset: its dimensions, values and attributes."""


def labelled(
    name: str, dims: str | tuple[str, ...], values: ArrayLike, units: str
) -> Labelled:
    """Return a variable for a Dataset, with its units and long name."""
    return dims, np.asarray(values), {"units": units, "long_name": name}


def labels(table: str) -> dict[str, dict[str, str]]:
    """Return units and long names of variables, from rows ``name | unit | long name``,
    as attributes by name.
    """
    rows = (line.split(" | ") for line in table.strip().split("\n"))
    return {name: {"units": unit, "long_name": words} for name, unit, words in rows}


def units_of(variable: xr.DataArray | xr.Variable | None) -> str:
    """Return the unit of a variable; empty if it has none, or is None."""
    return "" if variable is None else str(variable.attrs.get("units", ""))
