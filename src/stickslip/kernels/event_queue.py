"""A bucket queue: entries (key, slot) in bins of equal width, of which only the bin in
use is kept sorted.

The cost of adding an entry and of taking the smallest does not grow with their number,
as long as keys come from a range that moves slowly. A bin is a list of short chunks of
consecutive memory: taking a bin into use waits for the memory once, not once per entry,
and adding an entry does not wait at all. An entry stays at its place until it is taken
or dropped, so it may hold more than key and slot, and can be found again: the data of a
contact, two contacts to a cache line.
"""

import math
from typing import NamedTuple

import numpy as np

from ._jit import bare, inlined
from .records import Counts, Floats, Indices, Records

_ENTRY = np.dtype(
    [
        ("key", "f8"),
        ("slot", "i4"),
        ("other", "i4"),
        ("birth", "f8"),
        ("threshold", "f8"),
    ]
)
"""Key and slot, and further data of the user; one type for all queues, so that kernels
are compiled once.
"""

_CHUNK = 4  # entries in a piece of memory; a power of two
_SHIFT = 2  # its logarithm


class Queue(NamedTuple):
    """Entries in order of their keys.

    ``entries`` is divided into chunks; a key of infinity marks a place without an
    entry. ``newest[b]`` is the last place filled in bin number ``b`` modulo the number
    of bins, and ``before[c]`` is the chunk of the same bin filled before chunk ``c``.
    The bin in use is sorted in ``front_key`` and ``front_place``, between
    ``counts[FIRST]`` and ``counts[LAST]``.
    """

    newest: Indices
    before: Indices
    entries: Records
    front_key: Floats
    front_place: Indices
    counts: Counts
    per_bin: float  # bins per unit of key
    capacity: int


_FREE = 0  # first chunk in the list of freed chunks
_UNUSED = 1  # first chunk that was never used
_SIZE = 2
BIN = 3  # number of the bin in use
FIRST = 4
LAST = 5
MOVED = 6  # whether entries were moved to other places


def make_queue(capacity: int, bins: int, width: float) -> Queue:
    """Return an empty queue; `bins` is a power of two, and any `width` is correct; at
    the best width a bin holds a dozen entries.
    """
    # one more chunk for moving entries
    chunks = capacity // _CHUNK + min(bins, capacity) + capacity // (4 * _CHUNK) + 2
    queue = Queue(
        newest=np.empty(bins, np.int32),
        before=np.empty(chunks, np.int32),
        entries=np.empty(chunks * _CHUNK, _ENTRY),
        front_key=np.empty(capacity),
        front_place=np.empty(capacity, np.int32),
        counts=np.zeros(7, np.int64),
        per_bin=1.0 / width,
        capacity=capacity,
    )
    clear(queue, 0.0)
    return queue


@bare
def clear(queue: Queue, key: float) -> None:
    """Empty the queue and make the bin of `key` the bin in use."""
    queue.newest[:] = -1
    queue.counts[:] = 0
    queue.counts[_FREE] = -1
    queue.counts[BIN] = math.floor(key * queue.per_bin)


@inlined
def wide(number: int) -> int:
    """Convert a slot or a place, a 32-bit number in an entry, to the 64-bit type of all
    other numbers, so that kernels are compiled for one type.
    """
    return number + 0


@inlined
def size(queue: Queue) -> int:
    """Number of entries in the queue."""
    return int(queue.counts[_SIZE])


@inlined
def used(queue: Queue) -> int:
    """Number of places in use: all entries are below it."""
    return int(queue.counts[_UNUSED]) * _CHUNK


@inlined
def _put(queue: Queue, chain: int) -> int:
    """Return a place for a new entry of a bin."""
    place = queue.newest[chain] + 1
    if place & (_CHUNK - 1) == 0:  # the chunk is full, or there is none: an end of -1
        place = _new_chunk(queue, (place >> _SHIFT) - 1)
    queue.newest[chain] = place
    return int(place)


@inlined
def _new_chunk(queue: Queue, before: int) -> int:
    """Return the first place of an empty chunk."""
    counts = queue.counts
    chunk = counts[_FREE]
    if chunk >= 0:
        counts[_FREE] = queue.before[chunk]
    else:
        chunk = counts[_UNUSED]
        counts[_UNUSED] = chunk + 1
        for place in range(chunk * _CHUNK, (chunk + 1) * _CHUNK):
            queue.entries[place]["key"] = np.inf
    queue.before[chunk] = before
    return int(chunk) * _CHUNK


@inlined
def push(queue: Queue, key: float, slot: int) -> int:
    """Add an entry, whose further data the caller may fill in, and return its place;
    the queue must not be full.
    """
    counts = queue.counts
    # except for the chunk kept for moving entries
    if counts[_FREE] < 0 and counts[_UNUSED] >= queue.before.size - 1:
        _pack(queue)
    bin_ = math.floor(key * queue.per_bin)
    if bin_ < counts[BIN] or counts[FIRST] == counts[LAST]:
        # A smaller key has come, as when the slider reverses: reset the front, which is
        # only a view of its bin.
        counts[FIRST] = counts[LAST] = 0
        counts[BIN] = min(counts[BIN], bin_ - 1)
    place = _put(queue, bin_ & (queue.newest.size - 1))
    queue.entries[place]["key"] = key
    queue.entries[place]["slot"] = slot
    counts[_SIZE] += 1
    if bin_ == counts[BIN]:
        _insert(queue, key, place)
    return place


@inlined
def _insert(queue: Queue, key: float, place: int) -> None:
    """Insert an entry of the bin in use in the order of its key."""
    counts = queue.counts
    first = counts[FIRST]
    last = counts[LAST]
    # there is room at the places of taken or dropped entries
    if last == queue.front_key.size:
        last = 0
        for i in range(first, queue.front_key.size):
            if queue.entries[queue.front_place[i]]["key"] < np.inf:
                queue.front_key[last] = queue.front_key[i]
                queue.front_place[last] = queue.front_place[i]
                last += 1
        first = 0
    i = last
    while i > first and queue.front_key[i - 1] > key:
        queue.front_key[i] = queue.front_key[i - 1]
        queue.front_place[i] = queue.front_place[i - 1]
        i -= 1
    queue.front_key[i] = key
    queue.front_place[i] = place
    counts[FIRST] = first
    counts[LAST] = last + 1


@inlined
def peek(queue: Queue) -> float:
    """Smallest key; infinite if the queue is empty."""
    counts = queue.counts
    while counts[FIRST] < counts[LAST]:
        key = queue.entries[queue.front_place[counts[FIRST]]]["key"]
        if key < np.inf:
            return float(key)
        counts[FIRST] += 1  # the entry was dropped
    if counts[_SIZE] == 0:
        return np.inf
    _next_bin(queue)
    return float(queue.front_key[counts[FIRST]])


@bare
def _next_bin(queue: Queue) -> None:
    """Advance to the next bin that is not empty."""
    counts = queue.counts
    last = queue.newest.size - 1
    if queue.newest[counts[BIN] & last] >= 0:
        _free_chunks(queue, counts[BIN] & last)
    counts[FIRST] = counts[LAST] = 0
    empty_bins = 0
    # ends: some entry is in the queue, at most one turn of the wheel ahead
    while counts[LAST] == 0:
        if empty_bins > queue.newest.size:
            lowest = np.inf
            for place in range(used(queue)):
                lowest = min(lowest, queue.entries[place]["key"])
            counts[BIN] = math.floor(lowest * queue.per_bin) - 1
        counts[BIN] += 1
        empty_bins += 1
        if queue.newest[counts[BIN] & last] >= 0:
            _load(queue)


@inlined
def first_place(queue: Queue) -> int:
    """Place of the entry with the smallest key; `peek` must have been called before."""
    return wide(queue.front_place[queue.counts[FIRST]])


@inlined
def first_slot(queue: Queue) -> int:
    """Slot of the entry with the smallest key; `peek` must have been called before."""
    return wide(queue.entries[first_place(queue)]["slot"])


@inlined
def pop(queue: Queue) -> None:
    """Drop the entry with the smallest key; `peek` must have been called before."""
    drop(queue, first_place(queue))
    queue.counts[FIRST] += 1


@inlined
def drop(queue: Queue, place: int) -> None:
    """Drop the entry at a place."""
    queue.entries[place]["key"] = np.inf
    queue.counts[_SIZE] -= 1


@inlined
def _load(queue: Queue) -> None:
    """Sort the entries of the bin in use."""
    counts = queue.counts
    bin_ = counts[BIN]
    place = queue.newest[bin_ & (queue.newest.size - 1)]
    count = 0
    # ends: a chain of chunks has a last one
    while place >= 0:
        chunk = place >> _SHIFT
        for here in range(place, chunk * _CHUNK - 1, -1):
            key = queue.entries[here]["key"]
            # other entries belong to a later turn of the wheel
            if key < np.inf and math.floor(key * queue.per_bin) == bin_:
                queue.front_key[count] = key
                queue.front_place[count] = here
                count += 1
        place = (queue.before[chunk] << _SHIFT) + _CHUNK - 1
    counts[LAST] = count
    _sort_front(queue)


@inlined
def _free_chunks(queue: Queue, chain: int) -> None:
    """Free the chunks of a bin that have no entry left."""
    place = queue.newest[chain]
    after = -1
    # ends: a chain of chunks has a last one
    while place >= 0:
        chunk = place >> _SHIFT
        before = queue.before[chunk]
        least = np.inf
        for here in range(chunk * _CHUNK, place + 1):
            least = min(least, queue.entries[here]["key"])
        place = (before << _SHIFT) + _CHUNK - 1
        if least < np.inf:
            after = chunk
            continue
        if after < 0:
            queue.newest[chain] = place
        else:
            queue.before[after] = before
        queue.before[chunk] = queue.counts[_FREE]
        queue.counts[_FREE] = chunk


@bare
def _pack(queue: Queue) -> None:
    """Move entries together, as dropped entries leave free places anywhere."""
    counts = queue.counts
    entries = queue.entries
    aside = entries[entries.size - _CHUNK :]
    if counts[FIRST] < counts[LAST]:
        counts[FIRST] = counts[LAST] = 0
        counts[BIN] -= 1
    counts[MOVED] = 1
    for chain in range(queue.newest.size):
        place = queue.newest[chain]
        queue.newest[chain] = -1
        # ends: a chain of chunks has a last one
        while place >= 0:
            chunk = place >> _SHIFT
            count = 0
            for here in range(chunk * _CHUNK, place + 1):
                if entries[here]["key"] < np.inf:
                    aside[count] = entries[here]
                    entries[here]["key"] = np.inf
                    count += 1
            place = (queue.before[chunk] << _SHIFT) + _CHUNK - 1
            queue.before[chunk] = counts[_FREE]
            counts[_FREE] = chunk
            for i in range(count):
                entries[_put(queue, chain)] = aside[i]


@inlined
def _sort_front(queue: Queue) -> None:
    # A bin is read from its newest entry on; times of re-attachment come in order, so
    # after reversing they are sorted already.
    keys = queue.front_key
    places = queue.front_place
    count = queue.counts[LAST]
    for i in range(count // 2):
        j = count - 1 - i
        keys[i], keys[j] = keys[j], keys[i]
        places[i], places[j] = places[j], places[i]
    stride = 1
    # ends: the stride triples in each turn
    while stride < count // 9:
        stride = 3 * stride + 1
    # ends: a third of the stride is left in each turn
    while stride > 0:  # Shell sort: bins are short, and it needs no memory
        for i in range(stride, count):
            key = keys[i]
            place = places[i]
            j = i
            # ends: each turn is a stride down
            while j >= stride and keys[j - stride] > key:
                keys[j] = keys[j - stride]
                places[j] = places[j - stride]
                j -= stride
            keys[j] = key
            places[j] = place
        stride //= 3
