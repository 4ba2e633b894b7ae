"""Studies and their cases: the key and the seed of a case, and how a worker runs it."""

import hashlib
import json
import os
import time
import traceback
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any

import numpy as np

from stickslip import __version__
from stickslip.errors import InputError, instance
from stickslip.model.records import Number, Record

AxisValue = float | int | bool | str

# variables of every result of a sweep, whose names measured variables may not have
ERROR = "error"
STATUS = "status"
DIED = {
    "error": (
        "WorkerDied: the worker process ended while it ran this case (killed, out "
        "of memory, or a crash)"
    )
}


def case_key(values: Mapping[str, AxisValue]) -> str:
    """Return the key of a case: the values of its axes as JSON, in order of names."""
    return json.dumps(values, sort_keys=True)


def case_seed(seed: int, key: str) -> int:
    """Return the seed of a case, 63 bits: equal in all sweeps with the same seed,
    independent of order, workers and other cases.

    It is a keyed hash of the content, as the numbered children of
    ``SeedSequence.spawn`` would change with the axes.
    """
    state = np.random.SeedSequence(seed).generate_state(16, np.uint32)
    root = state.astype("<u4").tobytes()
    digest = hashlib.blake2b(key.encode(), digest_size=8, key=root).digest()
    return int.from_bytes(digest, "little") >> 1


def check_name(place: str, name: object) -> None:
    """Raise `InputError` for a name that no variable of a Dataset can have, or that is
    taken.
    """
    if not isinstance(name, str) or "/" in name or name in (ERROR, STATUS):
        raise InputError(
            f"{place}: {name!r} is taken, or cannot be a name; use another text, "
            "without '/'"
        )


@dataclass(frozen=True, kw_only=True)
class NamedStudy(Record):
    """A function that a sweep runs, with the name and the version of its results.

    Finished cases are identified by this name and version alone, as the function's
    code, and all that it reads, may change unnoticed.
    """

    #: Function of one keyword for each axis and a ``seed``, made from the study's seed
    #: and the values of the axes unless it is an axis itself; it returns a mapping of
    #: names to numbers (stored as float64), texts, truth values (0 and 1), or None (no
    #: value).
    run: Callable[..., Mapping[str, Any]]
    name: str
    #: Change it whenever the results change.
    version: str
    seed: Annotated[int, Number(at_least=0)] = 0  #: seed of the study, at least 0
    #: Attributes (``units``, ``long_name``) by name of axis or measured variable.
    attributes: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    #: Possible values of a measured text: it is stored as an integer with CF flags, -1
    #: where there is no result.
    categories: Mapping[str, Sequence[str]] = field(default_factory=dict)
    #: Texts that are stored with the results, as attributes of the Dataset.
    notes: Mapping[str, str] = field(default_factory=dict)
    #: version of the package where the sweep was started
    package: str = __version__

    def __post_init__(self) -> None:
        super().__post_init__()
        instance("NamedStudy.run", self.run, Callable, "a function of the axes")  # type: ignore[arg-type]
        for name, example in (("name", "beam of two parts"), ("version", "1")):
            place = f"NamedStudy.{name}"
            text = getattr(self, name)
            if not text.strip():
                raise InputError(
                    f"{place} = {text!r}: finished cases are kept by the name and the "
                    f"version of their study; give {name}={example!r}"
                )

    def identity(self, axes: Iterable[str]) -> dict[str, str]:
        """Return what must be equal for a finished case to be the same case, by name so
        that a message can list what differs.
        """
        return {
            "stickslip version": __version__,
            "names of the axes": ", ".join(sorted(axes)),
            "seed": str(self.seed),
            "study": self.name,
            "version of the study": self.version,
        }


def run_batch(study: NamedStudy, keys: Sequence[str], seconds: float) -> list[str]:
    """Run cases, at least one, until all are done or the time is up."""
    if study.package != __version__:
        raise InputError(
            f"a worker has stickslip {__version__}, but the sweep {study.package}; "
            "install the same"
        )
    end = time.perf_counter() + seconds
    rows: list[str] = []
    for key in keys:
        rows.append(_run(study, key))
        if time.perf_counter() > end:
            break
    return rows


def _run(study: NamedStudy, key: str) -> str:
    """Run one case; return ``{"result": {name: value}}`` or ``{"error": text}`` as
    JSON.
    """
    axes = json.loads(key)
    try:
        result: Any = study.run(**{"seed": case_seed(study.seed, key), **axes})
        if not isinstance(result, Mapping) or not result:
            raise TypeError(
                f"{study.name} returned {result!r}: must be a mapping of names to "
                "numbers"
            )
        for name, value in axes.items():
            if result.get(name, value) != value:
                raise InputError(f"result: the name {name!r} is taken by an axis")
        row = {
            name: _plain(name, value, study.categories.get(name))
            for name, value in result.items()
            if name not in axes
        }
        return json.dumps({"result": row})
    except (Exception, SystemExit) as error:
        frame = traceback.extract_tb(error.__traceback__)[-1]
        place = f"{os.path.basename(frame.filename)}:{frame.lineno}"
        return json.dumps({"error": f"{type(error).__name__}: {error} ({place})"})


def _plain(name: str, value: Any, words: Sequence[str] | None) -> float | str | None:
    """Return a value in a form that JSON holds exactly."""
    check_name("result", name)
    plain = value.item() if isinstance(value, np.generic) else value
    if words is not None and plain not in (None, *words):
        raise ValueError(f"{name} = {plain!r}: must be one of {', '.join(words)}")
    if isinstance(plain, int):
        return float(plain)
    if not isinstance(plain, float | str | None):
        raise TypeError(
            f"returned {plain!r} for {name!r}: must be a number, a text or None"
        )
    return plain
