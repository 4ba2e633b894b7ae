"""Tournaments: the smallest of N numbers is always known, and so is whose it is; changing one costs a few comparisons.

A tournament is one array: the numbers of the N slots, then the smallest of each eight of them, of each eight of those,
and so on; the last entry is the smallest of all. Eight numbers are a cache line, so a change reads one line a level.
Many small tournaments lie side by side in a matrix, where a bucket queue for each would be mostly empty bins. Nothing
goes stale and nothing is ever full.
"""

import numpy as np

from ._jit import bare, inlined
from .records import Floats


def tournaments(count: int, slots: int) -> Floats:
    """Return `count` tournaments in which every slot holds infinity."""
    size, level = slots, slots
    while level > 1:
        level = (level + 7) // 8
        size += level
    return np.full((count, size), np.inf)


@inlined
def smallest(tree: Floats) -> float:
    """Smallest number."""
    return float(tree[tree.size - 1])


@inlined
def winner(tree: Floats, slots: int) -> int:
    """Slot of the smallest number; of the first among equals."""
    least = tree[tree.size - 1]
    levels, level = 0, slots
    while level > 1:
        level = (level + 7) // 8
        levels += 1
    node = 0
    for depth in range(levels - 1, -1, -1):
        base, level = 0, slots
        for _ in range(depth):
            base += level
            level = (level + 7) // 8
        node *= 8
        while tree[base + node] != least:
            node += 1
    return node


@inlined
def enter(tree: Floats, slots: int, slot: int, value: float) -> None:
    """Give a slot another number."""
    tree[slot] = value
    base, level, node = 0, slots, slot
    while level > 1:
        node //= 8
        first = base + 8 * node
        base += level
        least = tree[first]
        for i in range(first + 1, min(first + 8, base)):
            least = min(least, tree[i])
        if tree[base + node] == least:
            break
        tree[base + node] = least
        level = (level + 7) // 8


@bare
def play(trees: Floats, slots: int) -> None:
    """Set up all tournaments anew from the numbers of their slots."""
    for j in range(trees.shape[0]):
        base, level = 0, slots
        while level > 1:
            above = (level + 7) // 8
            for node in range(above):
                least = np.inf
                for i in range(base + 8 * node, min(base + 8 * node + 8, base + level)):
                    least = min(least, trees[j, i])
                trees[j, base + level + node] = least
            base += level
            level = above
