"""The strokes of a reciprocating test."""

import itertools
from dataclasses import replace

import numpy as np

from stickslip.measure.periods import rises
from stickslip.measure.slips import turning_points
from stickslip.measure.trace import FEWEST_READINGS, Trace

# of the range of the displacement, or of the force: a stroke goes at least so far
LEAST_WAY = 0.5
# largest part of the time that a force between its two plateaus may take
IN_BETWEEN = 0.08


def find_strokes(trace: Trace) -> list[Trace]:
    """The strokes of a reciprocating test, each along its own direction and without
    the reversals; none of another.
    """
    edges = _reversals(trace)
    if len(edges) < 3:
        return []
    strokes = []
    for begin, end in itertools.pairwise(edges):
        part = trace.part(
            trace.t[begin], trace.t[end] if end < trace.t.size else np.inf
        )
        way = 1.0 if float(np.median(part.force)) >= 0 else -1.0
        there = part.t[way * part.force >= way * np.median(part.force)]
        loaded = part.part(there[0], np.nextafter(there[-1], np.inf))
        if loaded.t.size >= FEWEST_READINGS:
            force = way * loaded.force
            strokes.append(
                replace(
                    loaded,
                    force=force,
                    sign=way * trace.sign,
                    largest=float(force.max()),
                )
            )
    return strokes if len(strokes) > 1 else []


def _reversals(trace: Trace) -> list[int]:
    """First samples of strokes, and the end of the last: by displacement, or a force
    with plateaus of either sign.
    """
    size = trace.t.size
    if (way := trace.displacement) is not None:
        least = LEAST_WAY * float(np.ptp(way))
        peaks, troughs = turning_points(way, least) if least > 0 else ((), ())
        return [0, *sorted({*peaks, *troughs} - {0, size - 1}), size]
    low, high = (float(edge) for edge in np.quantile(trace.force, (0.05, 0.95)))
    middle = 0.5 * (high + low)
    level = LEAST_WAY * 0.5 * (high - low)
    between = float(np.mean(np.abs(trace.force - middle) < level))
    if not low < 0 < high or abs(middle) > level or between > IN_BETWEEN:
        return []
    crossed = (
        rises(trace.t, force, -level, level)[0].tolist()
        for force in (trace.force, -trace.force)
    )
    return [0, *sorted(itertools.chain(*crossed)), size]
