"""What the pages ask for: a document in, plain data out. No state.

An answer is a generator: what it yields is sent at once, so that the force trace does not wait for what takes longer.
It takes a `Watch`, which it calls now and then with the fraction of the work done, and which ends work that nobody
waits for any more by raising.
"""

from collections.abc import Callable, Iterator, Mapping
from functools import partial

from stickslip.explorer import fronts, simulate, stability, traces
from stickslip.explorer.plain import Plain, Watch

ANSWERS: Mapping[str, Callable[[Plain, Watch], Iterator[Plain]]] = {
    "run": simulate.run,
    "law": simulate.law,
    "stretchings": simulate.stretchings,
    "contacts": simulate.contacts,
    "edit": simulate.edit,
    "chart": stability.chart,
    "advice": stability.advice,
    "fronts": fronts.fronts,
    "trace": traces.trace,
    "sample": traces.sample,
    "fit": traces.fit,
    "posterior": traces.posterior,
} | {form: partial(simulate.download, form) for form in ("nc", "png", "svg", "toml")}
"""What a window can ask."""
SLOW = ("chart", "advice", "fronts", "posterior")
