"""Sliding bodies: a rigid slider, or coupled blocks that each rest on their own
contacts.

An elastic body consists of masses, a symmetric network of springs and dashpots between
them, and the springs that pull them. `Chain` and `Sheet` are defined by a few numbers;
solvers and theory ask each for its number of blocks (`size`), the springs that pull
them (`pulled`) and the springs that couple them (`links`).
"""

import math
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from stickslip.arrays import Array
from stickslip.model.records import Number, Record, registry

Links = tuple[NDArray[np.int64], Array]
"""Pairs of coupled blocks, shape (links, 2), and the stiffness of each spring, shape
(links,).
"""


Damping = Annotated[float, Number("1/time", at_least=0, hint="eta")]
MassAbove0 = Annotated[float, Number("f_s time^2/x_s", above=0, hint="M/N")]


@dataclass(frozen=True, kw_only=True)
class Slider(Record):
    """The slider and its driving spring, Eq. (11), per contact.

    Called as a function, it returns the mechanical impedance ``Z(s) = M s^2 + M eta s +
    K``, force over displacement.

    Parameters
    ----------
    stiffness : float
        Stiffness of the driving spring ``K/N`` in units of ``k``.
    mass : float
        ``M/N`` in units of ``f_s * time**2 / x_s``. Zero is the massless limit, in
        the theory of stability only.
    damping : float
        ``eta`` in 1/time.
    """

    stiffness: Annotated[float, Number("k", above=0, hint="K/N")]
    mass: Annotated[float, Number("f_s time^2/x_s", at_least=0, hint="M/N")]
    damping: Damping

    def __call__(self, s: NDArray[Any], /) -> NDArray[Any]:
        """Force over displacement for motion as ``exp(s t)``, at each `s` in 1/time."""
        return np.asarray(
            self.stiffness + self.mass * s * (s + self.damping), dtype=complex
        )

    @property
    def frequency(self) -> float:
        """Angular frequency ``Omega = sqrt(K/M)`` of the slider on its spring alone;
        infinite without mass.
        """
        return math.sqrt(self.stiffness / self.mass) if self.mass > 0 else math.inf

    @property
    def damping_ratio(self) -> float:
        """Damping ratio ``zeta = eta/(2 Omega)`` of the slider on its spring alone;
        zero without mass.
        """
        return 0.5 * self.damping / self.frequency


@dataclass(frozen=True, kw_only=True)
class Mass(Record):
    """A slider without a driving spring, pulled by a force (`pull`), per contact.

    Parameters
    ----------
    mass : float
        ``M/N`` in units of ``f_s * time**2 / x_s``.
    damping : float
        ``eta`` in 1/time.

    Examples
    --------
    >>> ss.model.Mass(mass=0.5).damping
    0.0
    """

    mass: MassAbove0
    damping: Damping = 0.0


BODIES, register = registry("body")
"""The elastic bodies, by the name of their table in rig files; ``@register("chain")``
gives a class its name there.
"""


@dataclass(frozen=True, kw_only=True)
class ElasticBody(Record):
    """Base of elastic bodies: equal blocks, each on its own contacts; all numbers are
    per contact of a block.

    A user's body derives from this class, is registered under the name of its table in
    rig files, and gives its `size`, the springs that pull its blocks (`pulled`) and the
    springs that couple them (`links`).
    """

    coupling: Annotated[
        float,
        Number(
            "k",
            above=0,
            hint="k_b, between neighbours along the drive, per contact",
        ),
    ]
    mass: Annotated[float, Number("f_s time^2/x_s", above=0, hint="M/N of a block")]
    damping: Damping
    viscosity: Annotated[
        float, Number("f_s time/x_s", at_least=0, hint="c_b, beside the coupling")
    ] = 0.0
    leaf: Annotated[
        float, Number("k", at_least=0, hint="spring from every block to the drive")
    ] = 0.0
    side: Annotated[
        float,
        Number(
            "k",
            at_least=0,
            hint="spring from the first block of a row to the drive",
        ),
    ] = 0.0
    ends: Literal["free", "periodic"] = "free"
    spacing: Annotated[
        float | None, Number("x_s", above=0, hint="length of a block")
    ] = None

    @property
    def size(self) -> int:
        """Number of blocks."""
        raise NotImplementedError

    @property
    def rows(self) -> int:
        """Number of rows side by side; blocks are numbered along the drive first."""
        return 1

    @property
    def links(self) -> Links:
        """The springs between blocks: along each row, then between rows."""
        block = np.arange(self.size).reshape(self.rows, -1)
        along = self._neighbours(block)
        across = self._neighbours(block.T)
        stiffness = np.repeat(
            [self.coupling, getattr(self, "shear", math.nan)], [len(along), len(across)]
        )
        return np.concatenate([along, across]), stiffness

    @property
    def pulled(self) -> Array:
        """Stiffness of the spring from each block to the drive, shape (size,)."""
        springs = np.full((self.rows, self.size // self.rows), self.leaf)
        springs[:, 0] += self.side
        return springs.ravel()

    @property
    def sound_speed(self) -> float:
        """Speed ``sqrt(k_b/M)`` of long waves along the free body, in blocks per
        time.
        """
        return math.sqrt(self.coupling / self.mass)

    def _neighbours(self, block: NDArray[np.int64]) -> NDArray[np.int64]:
        """Pairs of neighbours in each row of blocks.

        A ring of two blocks would couple them twice, and is left open.
        """
        pairs = np.stack([block[:, :-1], block[:, 1:]], axis=-1)
        if self.ends == "periodic" and block.shape[1] > 2:
            pairs = np.concatenate([pairs, block[:, None, [-1, 0]]], axis=1)
        return pairs.reshape(-1, 2)


@register("chain")
@dataclass(frozen=True, kw_only=True)
class Chain(ElasticBody):
    """A bar of equal blocks in a row, each on its own contacts; all numbers are per
    contact of a block.

    Each block moves by

        M X_j'' + M eta X_j' = K_j (D - X_j) + k_b sum (X_l - X_j) + c_b sum (X_l' -
        X_j') - F_j

    with the sums over its neighbours, ``K_j = leaf`` (and ``+ side`` for block 0), and
    ``F_j`` the mean force of its contacts. Twice as many blocks for the same bar mean
    four times the `coupling` and `viscosity`, all else unchanged.

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
        Length of a block along the drive, in units of ``x_s``; the speeds of fronts are
        then given as velocities.

    Examples
    --------
    >>> bar = ss.Chain(blocks=200, coupling=25.0, mass=25.0, damping=0.2, leaf=0.25)
    >>> bar.sound_speed
    1.0
    """

    blocks: Annotated[
        int, Number(at_least=1, at_most=100_000_000, hint="number of blocks")
    ]

    @property
    def size(self) -> int:
        """Number of blocks."""
        return self.blocks


@register("sheet")
@dataclass(frozen=True, kw_only=True)
class Sheet(ElasticBody):
    """A sheet of equal blocks on contacts, seen from above; displacements along the
    drive only, per contact.

    Blocks are numbered along the drive first: block ``i + along * j`` is the ``i``-th
    in row ``j``. The other parameters are those of a `Chain`: `coupling` acts between
    neighbours in a row, `side` on the first block of every row, and the dashpots
    between rows are in proportion to their stiffness.

    Parameters
    ----------
    along : int
        Number of blocks along the drive.
    across : int
        Number of rows side by side.
    shear : float
        Stiffness between neighbouring rows, in units of ``k``.

    Examples
    --------
    >>> ss.model.Sheet(
    ...     along=64,
    ...     across=16,
    ...     coupling=25.0,
    ...     shear=8.0,
    ...     mass=25.0,
    ...     damping=0.2,
    ...     leaf=0.25,
    ... ).size
    1024
    """

    along: Annotated[
        int,
        Number(
            at_least=1,
            at_most=100_000_000,
            hint="number of blocks along the drive",
        ),
    ]
    across: Annotated[
        int, Number(at_least=1, at_most=100_000_000, hint="number of rows")
    ]
    shear: Annotated[
        float, Number("k", above=0, hint="between neighbouring rows, per contact")
    ]

    @property
    def size(self) -> int:
        """Number of blocks."""
        return self.along * self.across

    @property
    def rows(self) -> int:
        """Number of rows."""
        return self.across


def coupling_matrix(body: ElasticBody) -> sparse.csr_array:
    """Stiffness matrix of the springs between the blocks of a body."""
    pairs, springs = body.links
    net = sparse.coo_array(
        (springs, (pairs[:, 0], pairs[:, 1])), shape=(body.size, body.size)
    )
    net = net + net.T
    return sparse.csr_array(sparse.diags_array(net.sum(axis=0)) - net)
