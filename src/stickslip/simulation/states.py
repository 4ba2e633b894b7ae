"""States of engines, stored in Datasets so that a run can be continued.

A state is pickled. As a file may come from anywhere, only arrays, random generators and
records from the packages that engines use are read back.
"""

from __future__ import annotations

import io
import pickle
from collections.abc import Collection
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.errors import InputError
from stickslip.io import datasets as store

if TYPE_CHECKING:
    import xarray as xr

NAME = "engine_state"
_ROOMS = ("kernels", "model", "simulation", "structures")
_NUMPY = frozenset(
    [
        "dtype",
        "ndarray",
        "record",
        "recarray",
        "_reconstruct",
        "scalar",
        "_frombuffer",
        "PCG64",
        "SeedSequence",
        "__bit_generator_ctor",
        "__generator_ctor",
        "__pyx_unpickle_SeedSequence",
    ]
)


def keep(run: xr.Dataset, state: object) -> xr.Dataset:
    """Return the run with a state added."""
    content = np.frombuffer(pickle.dumps(state, protocol=5), np.uint8)
    words = {"units": "1", "long_name": "state of the engine, for simulate(start=run)"}
    return run.assign({NAME: ("byte", content, words)})


def kept(run: xr.Dataset) -> Any:
    """Return the state stored in a run; `InputError` if there is none to be read."""
    if NAME not in run:
        raise InputError(
            "simulate: start: the run keeps no state to go on from; make it with "
            "output=Output(state=True)"
        )
    content = io.BytesIO(run[NAME].to_numpy().astype(np.uint8).tobytes())
    try:
        return _Unpickler(content, store.records().values()).load()
    except InputError:
        raise
    except Exception as error:  # a damaged file, or of another version, raises anything
        raise InputError(
            f"simulate: start: its state cannot be read ({type(error).__name__}): it "
            "is damaged or of another version; make the run again"
        ) from error


class _Unpickler(pickle.Unpickler):
    """Unpickler for the classes that engines are made of, and no others."""

    def __init__(self, file: io.BytesIO, guests: Collection[type]) -> None:
        super().__init__(file)
        self._guests = {(kind.__module__, kind.__qualname__): kind for kind in guests}

    def find_class(self, module: str, name: str) -> Any:
        """Return a class by its name, if it is allowed."""
        if guest := self._guests.get((module, name)):
            return guest
        package, _, rest = module.partition(".")
        if package == "numpy" and name in _NUMPY:
            return super().find_class(module, name)
        if package == "stickslip" and rest.partition(".")[0] in _ROOMS:
            found = super().find_class(module, name)
            if isinstance(found, type) and found.__module__ == module:
                return found
        raise InputError(
            f"simulate: start: its state holds {module}.{name}, which no engine has; "
            "make the run again"
        )
