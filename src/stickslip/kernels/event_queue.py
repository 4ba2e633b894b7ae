"""A bucket queue: entries (key, slot) in bins of equal width; only the bin in use is kept sorted.

What it costs to add an entry and to take the smallest does not grow with their number, as long as keys come from a
range that moves on slowly.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._jit import bare, inlined

Floats = NDArray[np.float64]
Indices = NDArray[np.int32]
Counts = NDArray[np.int64]
Records = NDArray[np.void]

# Fields used together lie together: one cache line an entry.
ENTRY = np.dtype([("key", np.float64), ("slot", np.int32), ("link", np.int32)])


class Queue(NamedTuple):
    """Entries waiting in order of their key.

    ``head[b]`` starts the chain of bin number ``b`` modulo their count. The bin in use lies sorted in ``front_key``
    and ``front_slot``, between ``counts[FIRST]`` and ``counts[LAST]``.
    """

    head: Indices
    entries: Records
    front_key: Floats
    front_slot: Indices
    counts: Counts
    per_bin: float  # bins per unit of key


_FREE = 0  # first entry of the chain of freed ones
_UNUSED = 1  # entries beyond this one were never used
_CHAINED = 2  # how many entries lie in bins
BIN = 3  # number of the bin in use
FIRST = 4
LAST = 5


def make_queue(capacity: int, bins: int, width: float) -> Queue:
    """Return an empty queue.

    Parameters
    ----------
    capacity : int
        Largest number of entries.
    bins : int
        Number of bins; a power of two.
    width : float
        Width of a bin, in the unit of the key. Any width is right; the best holds a dozen entries.
    """
    queue = Queue(
        head=np.empty(bins, np.int32),
        entries=np.empty(capacity, ENTRY),
        front_key=np.empty(capacity),
        front_slot=np.empty(capacity, np.int32),
        counts=np.zeros(6, np.int64),
        per_bin=1.0 / width,
    )
    clear(queue, 0.0)
    return queue


@bare
def clear(queue: Queue, key: float) -> None:
    """Empty the queue and put the bin of `key` in use."""
    queue.head[:] = -1
    counts = queue.counts
    counts[_FREE] = -1
    counts[_UNUSED] = 0
    counts[_CHAINED] = 0
    counts[BIN] = math.floor(key * queue.per_bin)
    counts[FIRST] = 0
    counts[LAST] = 0


@inlined
def size(queue: Queue) -> int:
    """How many entries wait."""
    counts = queue.counts
    return int(counts[_CHAINED] + counts[LAST] - counts[FIRST])


@inlined
def is_full(queue: Queue) -> bool:
    """Whether there is no room for another entry."""
    return size(queue) >= queue.entries.size


@inlined
def _chain(queue: Queue, key: float, slot: int) -> None:
    """Put an entry into its bin."""
    counts = queue.counts
    entry = counts[_FREE]
    if entry >= 0:
        counts[_FREE] = queue.entries[entry]["link"]
    else:
        entry = counts[_UNUSED]
        counts[_UNUSED] += 1
    bin_ = math.floor(key * queue.per_bin) & (queue.head.size - 1)
    queue.entries[entry]["key"] = key
    queue.entries[entry]["slot"] = slot
    queue.entries[entry]["link"] = queue.head[bin_]
    queue.head[bin_] = entry
    counts[_CHAINED] += 1


@inlined
def push(queue: Queue, key: float, slot: int) -> None:
    """Add an entry; the queue must not be full."""
    counts = queue.counts
    bin_ = math.floor(key * queue.per_bin)
    if bin_ < counts[BIN] or counts[FIRST] == counts[LAST]:
        _return_front(queue)
        counts[BIN] = min(counts[BIN], bin_ - 1)
    if bin_ > counts[BIN]:
        _chain(queue, key, slot)
        return
    first, last = counts[FIRST], counts[LAST]
    if last == queue.front_key.size:
        for i in range(first, last):
            queue.front_key[i - first] = queue.front_key[i]
            queue.front_slot[i - first] = queue.front_slot[i]
        first, last = 0, last - first
    place = last
    while place > first and queue.front_key[place - 1] > key:
        queue.front_key[place] = queue.front_key[place - 1]
        queue.front_slot[place] = queue.front_slot[place - 1]
        place -= 1
    queue.front_key[place] = key
    queue.front_slot[place] = slot
    counts[FIRST] = first
    counts[LAST] = last + 1


@inlined
def _return_front(queue: Queue) -> None:
    """Send the front back to its bin: something smaller has come, as when the slider turns back."""
    counts = queue.counts
    first, last = counts[FIRST], counts[LAST]
    counts[FIRST] = counts[LAST] = 0
    for i in range(first, last):
        _chain(queue, queue.front_key[i], queue.front_slot[i])


@inlined
def peek(queue: Queue) -> float:
    """Smallest key; infinite if the queue is empty."""
    counts = queue.counts
    if counts[FIRST] == counts[LAST]:
        if counts[_CHAINED] == 0:
            return np.inf
        counts[FIRST] = counts[LAST] = 0
        empty_bins = 0
        while counts[LAST] == 0:
            if empty_bins > queue.head.size:
                counts[BIN] = _lowest_bin(queue) - 1
            counts[BIN] += 1
            empty_bins += 1
            if queue.head[counts[BIN] & (queue.head.size - 1)] >= 0:
                _load(queue)
    return float(queue.front_key[counts[FIRST]])


@inlined
def first_slot(queue: Queue) -> int:
    """Slot of the entry with the smallest key; the queue must have been peeked at."""
    return int(queue.front_slot[queue.counts[FIRST]])


@inlined
def pop(queue: Queue) -> None:
    """Drop the entry with the smallest key; the queue must have been peeked at."""
    queue.counts[FIRST] += 1


@bare
def _lowest_bin(queue: Queue) -> int:
    lowest = np.inf
    for chain in range(queue.head.size):
        entry = queue.head[chain]
        while entry >= 0:
            lowest = min(lowest, queue.entries[entry]["key"])
            entry = queue.entries[entry]["link"]
    return math.floor(lowest * queue.per_bin)


@inlined
def _load(queue: Queue) -> None:
    """Move the entries of the bin in use from its chain to the front, and sort them."""
    counts = queue.counts
    bin_ = counts[BIN]
    chain = bin_ & (queue.head.size - 1)
    entry = queue.head[chain]
    kept = -1
    count = 0
    while entry >= 0:
        following = queue.entries[entry]["link"]
        if math.floor(queue.entries[entry]["key"] * queue.per_bin) == bin_:
            queue.front_key[count] = queue.entries[entry]["key"]
            queue.front_slot[count] = queue.entries[entry]["slot"]
            count += 1
            queue.entries[entry]["link"] = counts[_FREE]
            counts[_FREE] = entry
        else:  # an entry of a later turn of the wheel
            queue.entries[entry]["link"] = kept
            kept = entry
        entry = following
    queue.head[chain] = kept
    counts[_CHAINED] -= count
    counts[LAST] = count
    _sort_front(queue, count)


@inlined
def _sort_front(queue: Queue, count: int) -> None:
    # A chain holds its newest entry first; times of re-attachment come in order, so reversed they are sorted already.
    keys, slots = queue.front_key, queue.front_slot
    for i in range(count // 2):
        j = count - 1 - i
        keys[i], keys[j] = keys[j], keys[i]
        slots[i], slots[j] = slots[j], slots[i]
    stride = 1
    while stride < count // 9:
        stride = 3 * stride + 1
    while stride > 0:  # Shell's sort: bins are short, and it needs no memory
        for i in range(stride, count):
            key, slot = keys[i], slots[i]
            j = i
            while j >= stride and keys[j - stride] > key:
                keys[j] = keys[j - stride]
                slots[j] = slots[j - stride]
                j -= stride
            keys[j] = key
            slots[j] = slot
        stride //= 3
