"""Tournaments: the smallest of N numbers and its index are always known; changing a
number takes a few comparisons.

A tournament is one array, a tree whose nodes hold the smallest of eight each: the first
entry is the smallest of all, the entry at ``i`` is the smallest of those from
``8 i + 1`` on, and the last N entries are the numbers of the slots. Eight numbers are a
cache line, so a change reads about one line a level. Many small tournaments are the
rows of a matrix, where a bucket queue for each would have mostly empty bins. No entry
becomes outdated, and a tournament cannot be full.
"""

import numpy as np

from ._jit import bare, inlined
from .records import Floats


def tournaments(numbers: Floats) -> Floats:
    """Return a tournament for each row of numbers, which may be infinite."""
    count, slots = numbers.shape
    above = 0
    level = 1
    # ends: each level has eight times as many slots
    while level < slots:
        above += level
        level *= 8
    trees = np.empty((count, above + slots))
    trees[:, above:] = numbers
    play(trees, slots)
    return trees


@inlined
def smallest(tree: Floats) -> float:
    """Smallest number."""
    return float(tree[0])


@inlined
def winner(tree: Floats, slots: int) -> int:
    """Slot of the smallest number; the first slot among equal numbers."""
    above = tree.size - slots
    node = 0
    while node < above:
        node = 8 * node + 1
        while tree[node] != tree[0]:
            node += 1
    return node - above


@inlined
def _least(tree: Floats, node: int) -> float:
    """Smallest of the eight below a node."""
    least = np.inf
    for i in range(8 * node + 1, min(8 * node + 9, tree.size)):
        least = min(least, tree[i])
    return least


@inlined
def enter(
    tree: Floats,
    slots: int,
    slot: int,
    value: float,
) -> None:
    """Change the number of a slot."""
    node = tree.size - slots + slot
    old = tree[node]
    tree[node] = value
    # ends: each turn is a level up
    while node > 0 and value != old:
        node = (node - 1) // 8
        least = tree[node]
        if min(old, value) > least:
            break
        tree[node] = value if value < least else _least(tree, node)
        old = least
        value = tree[node]


@bare
def play(trees: Floats, slots: int) -> None:
    """Compute all tournaments from the numbers of their slots."""
    for tree in trees:
        for node in range(tree.size - slots - 1, -1, -1):
            tree[node] = _least(tree, node)
