"""What the pages ask for: a document in, plain data out. No state.

An answer is a generator: what it yields is sent at once, so that the force trace does not wait for what takes longer.
It takes a `Watch`, which it calls now and then with the fraction of the work done, and which ends work that nobody
waits for any more by raising.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from stickslip.explorer import fronts, simulate, stability, traces

ANSWERS: Mapping[str, Callable[..., Iterator[Any]]] = {
    "run": simulate.run,
    "law": simulate.law,
    "stretchings": simulate.stretchings,
    "contacts": simulate.contacts,
    "edit": simulate.edit,
    "chart": stability.chart,
    "band": stability.band,
    "advice": stability.advice,
    "trace": traces.trace,
    "fit": traces.fit,
    "posterior": traces.posterior,
    "download": simulate.download,
    "fronts": fronts.fronts,
    "sample": traces.sample,
}
"""What a worker can be asked; the last argument of each is its watch."""
QUICK, SLOW = ("run", "law", "stretchings", "contacts", "edit"), ("chart", "band", "advice", "fronts")
"""Questions of a window."""
