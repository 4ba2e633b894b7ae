"""The speed of a slip front along an elastic slider, and the prestress below which
there is none.
"""

import math
from dataclasses import dataclass, replace
from typing import Annotated, Literal

from scipy.optimize import minimize_scalar

from stickslip.answers import Answer
from stickslip.elastic.lattice import lattice_prestress
from stickslip.elastic.precursors import elastic_parts, screening_length
from stickslip.elastic.threshold_front import Medium, rising, shoot, threshold
from stickslip.errors import InputError, number
from stickslip.loops import HALVINGS, bounded
from stickslip.model import ElasticBody, Interface, Rig
from stickslip.model.records import Number, converted

# lowest speed, in units of the speed of sound, at which a front in a lattice is
# searched
SLOWEST = 0.01


@dataclass(frozen=True, kw_only=True, repr=False)
class Front(Answer):
    """A steady slip front by theory; ``float(front)`` is its speed."""

    #: in blocks per time of the rig's own units; 0 if there is no front
    speed: Annotated[float, Number("1/time")]
    sound_speed: Annotated[float, Number("1/time")]  #: in the same unit
    #: as given: from 0, the sliding force, to 1, the mean threshold
    prestress: float
    threshold: float  #: prestress below which there is no front in a bar of fine blocks
    screening_length: float  #: in blocks

    #: Theory used for the blocks: "lattice" if all thresholds are equal; "continuum",
    #: for blocks much smaller than the screening length, if they scatter.
    blocks: Literal["lattice", "continuum"]

    #: features of the rig outside the range of the theory
    caveats: tuple[str, ...] = ()

    @property
    def exists(self) -> bool:
        """Whether there is a front."""
        return self.speed > 0

    def __float__(self) -> float:
        return self.speed

    def __str__(self) -> str:
        sentence = f"no front at a prestress of {self.prestress:.4g}: "
        if self.exists:
            kind = "faster than" if self.speed > self.sound_speed else "slower than"
            sentence = (
                f"front at {self.speed:.6g} blocks per time, "
                f"{self.speed / self.sound_speed:.4g} times the speed of "
                f"sound ({kind} sound), at a prestress of {self.prestress:.4g} "
                f"({self.blocks})"
            )
        elif self.prestress <= self.threshold:
            sentence += f"fronts need more than {self.threshold:.4g}"
        else:
            sentence += (
                f"above the threshold of fine blocks, {self.threshold:.4g}, but "
                "these blocks pin it"
            )
        return "; ".join([sentence, *self.caveats])


def front_speed(rig: Rig, *, prestress: float) -> Front:
    """Return the speed of a steady slip front along an elastic slider whose contacts
    all have the same stretching.

    Behind the front contacts are detached and slide under `Interface.sliding_force`;
    none re-attaches as it passes.

    If all thresholds are equal, the front in a chain of blocks is known exactly
    (Wiener-Hopf), with leaf springs, damping, bulk viscosity and contacts of any
    stiffness; with a distribution of thresholds it is known in the continuum only.

    Parameters
    ----------
    rig : Rig
        A rig with a `Chain`, or a `Sheet` along which a straight front runs. The number
        of blocks, the ends, the side spring and the drive do not matter.
    prestress : float
        Force of the contacts ahead of the front, above the sliding force ``f_d`` and in
        units of its difference from the mean threshold: ``(tau_0 - f_d)/(f_s - f_d)``,
        between 0 and 1.

    Returns
    -------
    Front
        The front, with a speed of 0 if there is none: below `front_threshold`, or where
        blocks pin it.

    Raises
    ------
    InputError
        If the interface has a mechanism that the theory does not include, or the
        thresholds have a standard deviation and the bulk is viscous.

    Notes
    -----
    Accurate to 1e-6 on a lattice, down to a hundredth of the speed of sound; with a
    distribution of thresholds to 1e-6, in the limit of a long screening length and many
    contacts per block. There may be slower steady fronts on a lattice at the same
    prestress; the fastest is returned.

    Examples
    --------
    >>> interface = ss.Interface(thresholds=ss.Gaussian(mean=1.0, std=0.0), delay=ss.Delay(float("inf")))
    >>> bar = ss.Chain(blocks=400, coupling=4.0, mass=4.0, damping=0.3, leaf=0.2)
    >>> rig = ss.Rig(interface, bar, ss.constant(velocity=0.0, duration=1.0))
    >>> print(ss.elastic.front_speed(rig, prestress=0.6))
    front at 0.686408 blocks per time, 0.6864 times the speed of sound (slower than
    sound), at a prestress of 0.6 \
(lattice); slow fronts feel the blocks: the screening length is 1.848 of them
    """  # noqa: E501
    body, interface = elastic_parts(rig, "front_speed")
    tau = number(
        "prestress",
        prestress,
        above=0,
        below=1,
        hint="(tau_0 - f_d)/(f_s - f_d)",
    )
    alike = interface.threshold_distribution.single
    speed = _on_lattice(tau, body) if alike else _of_distribution(body, interface, tau)
    length = screening_length(rig)
    front = Front(
        speed=speed * body.sound_speed,
        sound_speed=body.sound_speed,
        prestress=tau,
        threshold=front_threshold(rig),
        screening_length=length,
        blocks="lattice" if alike else "continuum",
    )
    front = converted(front, lambda value, unit: value * rig.unit(unit))
    delay = interface.delay.moment(1) * rig.unit("time")
    return replace(front, caveats=_caveats(front.speed, length, delay))


def front_threshold(rig: Rig) -> float:
    """Return the smallest prestress at which a slip front advances, where it has no
    energy to spare.

    If all thresholds are equal it is Griffith's ``sqrt(K/(K + k))`` with leaf springs
    `K`; else it follows from equal areas above and below the force of the contacts as
    they break. It holds in the continuum; blocks of more than half a screening length
    pin fronts somewhat above it.

    Parameters
    ----------
    rig : Rig
        A rig with a `Chain` or a `Sheet`.

    Returns
    -------
    float
        As `prestress` of `front_speed`: above the sliding force, in units of its
        difference from the mean threshold. Infinite if thresholds scatter so much that
        there are no fronts.

    Raises
    ------
    InputError
        If the interface has a mechanism that the theory does not include.

    Examples
    --------
    >>> interface = ss.Interface(
    ...     thresholds=ss.Gaussian(mean=1.0, std=0.1), delay=ss.Delay(float("inf"))
    ... )
    >>> bar = ss.Chain(blocks=400, coupling=25.0, mass=25.0, damping=0.2, leaf=0.25)
    >>> round(
    ...     ss.elastic.front_threshold(
    ...         ss.Rig(interface, bar, ss.constant(velocity=0.0, duration=1.0))
    ...     ),
    ...     6,
    ... )
    0.449444
    """
    body, interface = elastic_parts(rig, "front_threshold")
    thresholds = interface.threshold_distribution
    sliding = interface.sliding_force
    if thresholds.single:
        return math.sqrt(body.leaf / (1.0 + body.leaf))
    found = threshold(Medium(thresholds, sliding, body.leaf, sliding))
    return (found - sliding) / (thresholds.moment(1) - sliding)


def _on_lattice(tau: float, body: ElasticBody) -> float:
    """Return the speed of the fastest front, in units of the speed of sound; 0 if there
    is none.
    """

    def lack(speed: float) -> float:
        return lattice_prestress(speed, body) - tau

    if lack(1.0) < 0:
        return rising(lack, 1.0, 1.0, 1.25)
    low = 1.0
    before = math.inf
    turns = bounded("front_speed", HALVINGS)
    while (here := lack(low)) > 0:
        next(turns)
        if here > before:  # slower fronts need more prestress: the lattice pins them
            lowest = minimize_scalar(
                lack,
                bounds=(low, low / 0.94**2),
                method="bounded",
                options={"xatol": 1e-9},
            )
            if lowest.fun > 0:
                return 0.0
            low = float(lowest.x)
            break
        if low < SLOWEST:
            return 0.0
        low = 0.94 * low
        before = here
    return rising(lack, low, low / 0.94, 1.0 / 0.94)


def _of_distribution(body: ElasticBody, interface: Interface, tau: float) -> float:
    if body.viscosity > 0:
        raise InputError(
            f"{type(body).__name__}.viscosity = {body.viscosity:g}: fronts in a "
            "viscous bar are known only where all "
            "thresholds are alike; give thresholds without standard deviation, or no "
            "viscosity"
        )
    thresholds = interface.threshold_distribution
    sliding = interface.sliding_force
    force = sliding + tau * (thresholds.moment(1) - sliding)
    eigenvalue = shoot(Medium(thresholds, sliding, body.leaf, force))
    if math.isinf(eigenvalue):
        raise InputError(
            f"prestress = {tau:g}: the contacts are past their largest force there and "
            "give way by themselves; lower it"
        )
    if eigenvalue == 0:
        return 0.0
    return 1.0 / math.sqrt(1.0 + body.mass * body.damping**2 / eigenvalue**2)


def _caveats(speed: float, length: float, delay: float) -> tuple[str, ...]:
    found = []
    if length < 2:
        found.append(
            f"slow fronts feel the blocks: the screening length is {length:.4g} of them"
        )
    if speed > 0 and delay * speed < 10 * length:
        found.append(
            f"contacts re-attach within the front, after {delay:g} on average: the "
            "theory leaves that out; it needs a "
            f"delay of more than {10 * length / speed:.3g}"
        )
    return tuple(found)
