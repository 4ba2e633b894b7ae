"""An elastic body: blocks of equal mass, the springs and dashpots between them, and the springs that pull them.

One abstraction for all bodies: a chain, a sheet, anything whose blocks have as many neighbours each. Forces are per
contact of a block, as is its mass.
"""

import math
from typing import NamedTuple

from ._jit import inlined
from .records import Floats, Indices


class Network(NamedTuple):
    """Constants of ``M X'' + M eta X' = pull (D - X) + load + sum of spring (1 + lag d/dt) (X_l - X) - F_c``."""

    neighbour: Indices  # shape (n, m); where a block has fewer than `m`, itself
    spring: Floats  # shape (n, m): stiffness towards each; 0 where there is none
    pull: Floats  # shape (n,): stiffness of the spring by which the drive pulls each block
    load: Floats  # shape (n,): constant force: of the driving spring with drive and block at 0, and what pushes
    push: Floats  # shape (n,): what part of `load` does work as the block moves: all but the force of a driving spring
    mass: float
    damping: float
    lag: float  # viscosity of a spring over its stiffness


def fastest(network: Network, contacts: float = 1.0) -> float:
    """Bound on the angular frequencies of the body with all of its contacts attached (Gershgorin's)."""
    per_block = network.pull + 2.0 * network.spring.sum(axis=1) + contacts
    return math.sqrt(float(per_block.max()) / network.mass)


def stiffest_dashpot(network: Network) -> float:
    """Bound on the rates at which the dashpots between blocks slow them down."""
    return 2.0 * network.lag * float(network.spring.sum(axis=1).max()) / network.mass


@inlined
def stretch(network: Network, Z: Floats, j: int) -> float:
    """Force of the neighbours on block `j` at displacements `Z`."""
    force = 0.0
    for m in range(network.spring.shape[1]):
        force += network.spring[j, m] * (Z[network.neighbour[j, m]] - Z[j])
    return force
