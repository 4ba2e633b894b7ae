"""Many cases over named axes, on any executor, resumable; and boundaries found with few
runs.

Of a rig: `stickslip.sweep` called as a function, and files, which
`stickslip.sweep.plan` reads. Of a study with a name and a version: `run_study`.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from types import ModuleType
from typing import TYPE_CHECKING

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

if TYPE_CHECKING:
    import xarray as xr

    from stickslip.model import Rig

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
]
__all__ += [
    "Summary",
    "Threads",
    "failures",
    "is_store",
    "open_sweep",
    "run_study",
    "status_of",
    "summary",
]


class _Callable(ModuleType):
    """The room of the sweeps is also their public function:
    ``stickslip.sweep(rig, axes)``.
    """

    def __call__(
        self,
        rig: Rig,
        axes: Mapping[str, Sequence[float | str] | Span],
        *,
        store: str | os.PathLike[str] | None = None,
        executor: Executor | None = None,
        refinement: Refinement | None = None,
        runs: Runs = Runs(),
        progress: Callable[[Progress], object] | None = None,
        retry_failed: bool = False,
    ) -> xr.Dataset:
        """Run a rig over some of its parameters; see `stickslip.sweep.plan.sweep`."""
        from stickslip.sweep.plan import sweep

        return sweep(
            rig,
            axes,
            store=store,
            executor=executor,
            refinement=refinement,
            runs=runs,
            progress=progress,
            retry_failed=retry_failed,
        )


sys.modules[__name__].__class__ = _Callable
