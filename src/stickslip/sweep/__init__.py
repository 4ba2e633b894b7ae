"""Many cases over named axes, on any executor, resumable; and boundaries found with few runs.

Sweeps that a file describes are read by `stickslip.sweep.plan`.
"""

from stickslip.sweep._pools import Processes, Threads
from stickslip.sweep._refine import Span, refine
from stickslip.sweep._run import Failure, Progress, Summary, failures, open_sweep, summary, sweep

__all__ = [
    "Failure",
    "Processes",
    "Progress",
    "Span",
    "Summary",
    "Threads",
    "failures",
    "open_sweep",
    "refine",
    "summary",
    "sweep",
]
