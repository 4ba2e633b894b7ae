"""Many cases over named axes, on any executor, resumable; and boundaries found with few
runs.

For a rig: `stickslip.sweep` called as a function, and sweep files, which
`stickslip.sweep.plan` reads. For a study with a name and a version: `run_study`.
"""

import inspect
import sys
from types import ModuleType

from stickslip.sweep import plan
from stickslip.sweep._cases import NamedStudy
from stickslip.sweep._dataset import (
    Failure,
    Status,
    Summary,
    failures,
    open_sweep,
    run_study,
    status_of,
    summary,
)
from stickslip.sweep._refine import Refinement, Span
from stickslip.sweep._run import MAX_CASES, Processes, Progress, Runs, Threads
from stickslip.sweep._table import is_store

__all__ = [
    "MAX_CASES",
    "Failure",
    "NamedStudy",
    "Processes",
    "Progress",
    "Refinement",
    "Runs",
    "Span",
    "Status",
    "Summary",
    "Threads",
    "failures",
    "is_store",
    "open_sweep",
    "run_study",
    "status_of",
    "summary",
]
__signature__ = inspect.signature(plan.sweep)


class _Callable(ModuleType):
    """The package of sweeps, which is also their public function:
    ``stickslip.sweep(rig, axes)``.
    """

    __call__ = staticmethod(plan.sweep)


sys.modules[__name__].__class__ = _Callable
