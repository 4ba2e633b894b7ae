"""A binary heap in which each slot has at most one entry, whose key can be changed.

For keys on all scales, as the times of a long hold have; `event_queue` is faster where they lie in a range.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._jit import inlined

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]


class Heap(NamedTuple):
    """Keys by slot, infinite for those that do not wait; the slots in heap order; and the place of each slot there."""

    key: Floats
    order: Indices
    place: Indices


def make_heap(key: Floats) -> Heap:
    """Return a heap of these keys, one for each slot."""
    order = np.argsort(key, kind="stable").astype(np.int64)
    place = np.empty(key.size, np.int64)
    place[order] = np.arange(key.size)
    return Heap(key.astype(float), order, place)


@inlined
def first(heap: Heap) -> int:
    """Slot of the smallest key."""
    return int(heap.order[0])


@inlined
def smallest(heap: Heap) -> float:
    """Smallest key."""
    return float(heap.key[heap.order[0]])


@inlined
def update(heap: Heap, slot: int, key: float) -> None:
    """Give a slot another key."""
    keys, order, place = heap.key, heap.order, heap.place
    i = place[slot]
    keys[slot] = key
    while i > 0:
        parent = (i - 1) >> 1
        other = order[parent]
        if keys[other] <= key:
            break
        order[i], place[other] = other, i
        i = parent
    count = order.size
    while True:
        child = 2 * i + 1
        if child >= count:
            break
        if child + 1 < count and keys[order[child + 1]] < keys[order[child]]:
            child += 1
        other = order[child]
        if keys[other] >= key:
            break
        order[i], place[other] = other, i
        i = child
    order[i], place[slot] = slot, i
