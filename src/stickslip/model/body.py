"""Elastic sliders: blocks that each rest on contacts of their own, coupled by springs and dashpots.

A body is masses, a symmetric network of springs, dashpots beside them, and the springs through which it is pulled.
`Chain` and `Sheet` say so in a few numbers; what solvers and theory ask of either is the same: how many blocks there
are (`size`), which springs pull them (`pulled`) and which couple them (`links`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import InputError, shown
from stickslip.model.records import Number, check

Array = NDArray[np.float64]
Links = tuple[NDArray[np.int64], Array]
"""Pairs of coupled blocks, shape (links, 2), and the stiffness of each spring, shape (links,)."""

Ends = Literal["free", "periodic"]


@dataclass(frozen=True, kw_only=True)
class Chain:
    """A bar of equal blocks in a row, each on contacts of its own; all numbers are per contact of a block.

    Each block moves by

        M X_j'' + M eta X_j' = K_j (D - X_j) + k_b sum (X_l - X_j) + c_b sum (X_l' - X_j') - F_j

    with the sums over its neighbours, ``K_j = leaf`` (and ``+ side`` for block 0), and ``F_j`` the mean force of its
    contacts. Twice as many blocks for the same bar mean four times the `coupling` and `viscosity`, all else unchanged.

    Parameters
    ----------
    blocks : int
        Number of blocks.
    coupling : float
        Stiffness ``k_b`` of the bar between neighbouring blocks, in units of ``k``.
    mass : float
        ``M/N`` of a block, in units of ``f_s * time**2 / x_s``.
    damping : float
        ``eta`` of a block against the ground, in 1/time.
    viscosity : float
        Dashpot ``c_b`` between neighbouring blocks, in units of ``k`` times time.
    leaf : float
        Stiffness of a spring from every block to the drive, in units of ``k``.
    side : float
        Stiffness of a spring from block 0 to the drive, in units of ``k``.
    ends : {"free", "periodic"}
        Whether the last block is coupled to the first.
    spacing : float, optional
        Length of a block along the drive, in units of ``x_s``; the speeds of fronts are then told as velocities.

    Raises
    ------
    InputError
        If a number is out of its bounds; the message names it.

    Examples
    --------
    >>> import stickslip as ss
    >>> bar = ss.Chain(blocks=200, coupling=25.0, mass=25.0, damping=0.2, leaf=0.25)
    >>> bar.sound_speed
    1.0
    """

    blocks: Annotated[int, Number(at_least=1, at_most=100_000_000, hint="number of blocks")]
    coupling: Annotated[float, Number("k", above=0, hint="k_b, the bar between neighbouring blocks, per contact")]
    mass: Annotated[float, Number("f_s time^2/x_s", above=0, hint="M/N of a block")]
    damping: Annotated[float, Number("1/time", at_least=0, hint="eta")]
    viscosity: Annotated[float, Number("f_s time/x_s", at_least=0, hint="c_b, beside the coupling")] = 0.0
    leaf: Annotated[float, Number("k", at_least=0, hint="spring from every block to the drive")] = 0.0
    side: Annotated[float, Number("k", at_least=0, hint="spring from block 0 to the drive")] = 0.0
    ends: Ends = "free"
    spacing: Annotated[float | None, Number("x_s", above=0, hint="length of a block")] = None

    def __post_init__(self) -> None:
        check(self)
        _check_ends("Chain.ends", self.ends)

    @property
    def size(self) -> int:
        """Number of blocks."""
        return self.blocks

    @property
    def sound_speed(self) -> float:
        """Speed ``sqrt(k_b/M)`` of long waves along the free bar, in blocks per time."""
        return math.sqrt(self.coupling / self.mass)

    @property
    def pulled(self) -> Array:
        """Stiffness of the spring from each block to the drive, shape (size,)."""
        springs = np.full(self.blocks, self.leaf)
        springs[0] += self.side
        return springs

    @property
    def links(self) -> Links:
        """The springs between blocks."""
        pairs = _row(np.arange(self.blocks), self.ends)
        return pairs, np.full(len(pairs), self.coupling)


@dataclass(frozen=True, kw_only=True)
class Sheet:
    """A sheet of equal blocks on contacts, seen from above; displacements along the drive only, per contact.

    Blocks are counted along the drive first: block ``i + along * j`` is the ``i``-th in row ``j``.

    Parameters
    ----------
    along : int
        Number of blocks along the drive.
    across : int
        Number of rows beside each other.
    coupling : float
        Stiffness between neighbours in a row, in units of ``k``.
    shear : float
        Stiffness between neighbouring rows, in units of ``k``.
    mass : float
        ``M/N`` of a block, in units of ``f_s * time**2 / x_s``.
    damping : float
        ``eta`` of a block against the ground, in 1/time.
    viscosity : float
        Dashpot beside the coupling, in units of ``k`` times time; beside the shear in proportion to its stiffness.
    leaf : float
        Stiffness of a spring from every block to the drive, in units of ``k``.
    side : float
        Stiffness of a spring from the first block of every row to the drive, in units of ``k``.
    ends : {"free", "periodic"}
        Whether opposite edges are coupled.
    spacing : float, optional
        Length of a block along the drive, in units of ``x_s``; the speeds of fronts are then told as velocities.

    Raises
    ------
    InputError
        If a number is out of its bounds; the message names it.

    Examples
    --------
    >>> import stickslip as ss
    >>> ss.Sheet(along=64, across=16, coupling=25.0, shear=8.0, mass=25.0, damping=0.2, leaf=0.25).size
    1024
    """

    along: Annotated[int, Number(at_least=1, at_most=100_000_000, hint="number of blocks along the drive")]
    across: Annotated[int, Number(at_least=1, at_most=100_000_000, hint="number of rows")]
    coupling: Annotated[float, Number("k", above=0, hint="between neighbours in a row, per contact")]
    shear: Annotated[float, Number("k", above=0, hint="between neighbouring rows, per contact")]
    mass: Annotated[float, Number("f_s time^2/x_s", above=0, hint="M/N of a block")]
    damping: Annotated[float, Number("1/time", at_least=0, hint="eta")]
    viscosity: Annotated[float, Number("f_s time/x_s", at_least=0, hint="beside the coupling")] = 0.0
    leaf: Annotated[float, Number("k", at_least=0, hint="spring from every block to the drive")] = 0.0
    side: Annotated[float, Number("k", at_least=0, hint="spring from the first block of a row to the drive")] = 0.0
    ends: Ends = "free"
    spacing: Annotated[float | None, Number("x_s", above=0, hint="length of a block")] = None

    def __post_init__(self) -> None:
        check(self)
        _check_ends("Sheet.ends", self.ends)

    @property
    def size(self) -> int:
        """Number of blocks."""
        return self.along * self.across

    @property
    def sound_speed(self) -> float:
        """Speed of long waves along the rows of the free sheet, in blocks per time."""
        return math.sqrt(self.coupling / self.mass)

    @property
    def pulled(self) -> Array:
        """Stiffness of the spring from each block to the drive, shape (size,)."""
        springs = np.full((self.across, self.along), self.leaf)
        springs[:, 0] += self.side
        return springs.ravel()

    @property
    def links(self) -> Links:
        """The springs between blocks."""
        block = np.arange(self.size).reshape(self.across, self.along)
        rows = np.concatenate([_row(line, self.ends) for line in block])
        columns = np.concatenate([_row(line, self.ends) for line in block.T])
        stiffness = np.concatenate([np.full(len(rows), self.coupling), np.full(len(columns), self.shear)])
        return np.concatenate([rows, columns]), stiffness


ElasticBody = Chain | Sheet
"""Bodies made of blocks."""


def _row(blocks: NDArray[np.int64], ends: Ends) -> NDArray[np.int64]:
    """Pairs of neighbours in a row; a ring of two would couple them twice, and is none."""
    pairs = np.column_stack([blocks[:-1], blocks[1:]])
    if ends == "periodic" and len(blocks) > 2:
        pairs = np.concatenate([pairs, [[blocks[-1], blocks[0]]]])
    return pairs


def _check_ends(place: str, ends: object) -> None:
    if ends not in get_args(Ends):
        raise InputError(f"{place} = {shown(ends)}: must be one of {', '.join(get_args(Ends))}", place)
