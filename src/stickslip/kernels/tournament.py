"""Tournaments: the smallest of N numbers is always known, and so is whose it is; changing one costs log2 N comparisons.

A tournament is an array of ``2 N`` numbers: those of the slots in its second half, and in entry `i` of the first the
smaller of entries ``2 i`` and ``2 i + 1``; entry 0 is not used. Many small ones lie side by side in a matrix, where a
bucket queue for each would be mostly empty bins. Nothing goes stale and nothing is ever full.
"""

import numpy as np
from numpy.typing import NDArray

from ._jit import bare, inlined

Floats = NDArray[np.float64]


def tournaments(count: int, slots: int) -> Floats:
    """Return `count` tournaments in which every slot holds infinity."""
    return np.full((count, 2 * max(slots, 1)), np.inf)


@inlined
def smallest(tree: Floats) -> float:
    """Smallest number."""
    return float(tree[1])


@inlined
def winner(tree: Floats) -> int:
    """Slot of the smallest number; of the first among equals, as the tree has them."""
    slots = tree.size // 2
    node, least = 1, tree[1]
    while node < slots:
        node *= 2
        if tree[node] != least:
            node += 1
    return node - slots


@inlined
def enter(tree: Floats, slot: int, value: float) -> None:
    """Give a slot another number."""
    node = slot + tree.size // 2
    tree[node] = value
    while node > 1:
        least = min(tree[node], tree[node ^ 1])
        node //= 2
        if tree[node] == least:
            break
        tree[node] = least


@bare
def play(trees: Floats) -> None:
    """Set up all tournaments anew from the numbers of their slots."""
    slots = trees.shape[1] // 2
    for j in range(trees.shape[0]):
        tree = trees[j]
        for node in range(slots - 1, 0, -1):
            tree[node] = min(tree[2 * node], tree[2 * node + 1])
