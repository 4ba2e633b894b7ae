"""The interface: the properties of its contacts."""

import math
from collections.abc import Collection
from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from typing import Annotated

from stickslip.errors import InputError
from stickslip.model.activation import Activation, ActivationModel, Barrier
from stickslip.model.ageing import AgeingModel, FixedGrowth, TabulatedGrowth
from stickslip.model.delays import Delay, DelayModel, OnArrest
from stickslip.model.distributions import Distribution, Gaussian
from stickslip.model.records import Number, Part, Record

_MECHANISMS = (
    "ageing",
    "activation",
    "sliding_force",
    "newborn",
    "slip_to_slip_scatter",
    "areas",
)
"""Fields of mechanisms; None or 0 where the interface does not have the mechanism."""
_SIZES = 1e-3, 1e3  # bounds of the median of the thresholds, in ``x_s``


@dataclass(frozen=True)
class Areas(Record):
    """Contacts of different areas ``a``, with the threshold force ``f_s = a`` and the
    stiffness ``k = sqrt(a)``: a contact breaks at the stretching ``sqrt(a)``.

    Parameters
    ----------
    distribution : Distribution
        Distribution of the areas, in units of the area whose threshold force and
        stiffness are 1; conditioned on positive values by the solvers.
    kept : bool
        Whether a contact keeps its area for life. Otherwise it draws a new one whenever
        it re-attaches. For exponential areas the kinetic friction is 1.5 times as large
        with new areas as with kept ones.

    Examples
    --------
    >>> areas = ss.model.Areas(ss.Exponential(mean=1.0), kept=True)
    >>> round(ss.kinetic_friction(ss.Interface(areas=areas), velocity=1.0), 3)
    0.5
    """

    distribution: Annotated[
        Distribution, Part("a distribution, such as Exponential(mean=1.0)")
    ]
    _: KW_ONLY
    kept: bool = False


@dataclass(frozen=True, kw_only=True)
class Interface(Record):
    """An interface made of many contacts.

    Parameters
    ----------
    thresholds : Distribution
        Distribution of the stretchings at which contacts break, ``P_c``; conditioned on
        positive values by the solvers. Its median must lie between 0.001 and 1000, as
        lengths are in units of ``x_s``. Omitted where `areas` are given.
    initial : Distribution
        Distribution of the stretchings at the start, ``Q(x; X=0)``; a contact that
        starts at ``x_0`` has a threshold beyond ``|x_0|``. `SteadyState` starts from
        the distribution of smooth sliding.
    delay : DelayModel
        Time that a broken contact stays detached.
    ageing : AgeingModel, optional
        Growth of thresholds with the age of a contact; by default none.
    activation : ActivationModel, optional
        Thermal activation, a `Bell`, `Parabolic` or `Barrier`, which breaks contacts
        before their threshold; by default none.
    sliding_force : float
        Force ``f_d`` of a detached contact while it slides, in ``f_s``, against the
        motion. All detached contacts slide together: when the slider reverses they
        follow it elastically, with their stiffness ``k``, until the force is ``f_d`` in
        the other direction.
    newborn : Distribution, optional
        Distribution of the stretchings with which contacts re-attach, along the motion
        of the slider; by default they are unstretched. A contact that re-attaches at
        ``x_0`` has a threshold beyond ``|x_0|``, as at the start.
        ``Gaussian(mean=f_d, std=0.0)`` re-attaches contacts with the force of sliding.
    slip_to_slip_scatter : float
        Scatter from slip to slip that all thresholds share: the standard deviation of a
        common factor, of mean 1, of all thresholds drawn between two arrests of the
        slider. The factor is log-normal, as the strength of a track is the product of
        many influences: it is positive, and half the strength is as likely as twice.
        With `areas` the factor applies to the areas; with kept areas, to those of the
        contacts that attach in this interval.
    areas : Areas, optional
        Areas of contacts that differ in stiffness and strength, in place of
        `thresholds`; by default all contacts have the same stiffness. Threshold forces
        grow with age by the rule of `ageing`; `sliding_force` is the force of a
        detached contact of any area. Steady sliding is known in closed form; runs
        require `Contacts`.

    Raises
    ------
    InputError
        If neither or both of `thresholds` and `areas` are given, a number is out of its
        bounds, or contacts start beyond the largest threshold.

    Examples
    --------
    >>> tenth = ss.Gaussian(mean=1.0, std=0.1)
    >>> ss.Interface(thresholds=tenth, delay=ss.Delay(0.2)).delay
    Delay(time=0.2)
    """

    thresholds: Annotated[
        Distribution | None,
        Part("a distribution, such as Gaussian(mean=1.0, std=0.1)"),
    ] = None
    initial: Annotated[
        Distribution, Part("a distribution, such as Gaussian(mean=0.0, std=0.01)")
    ] = Gaussian(0.0, 0.01)
    delay: Annotated[DelayModel, Part("a delay, such as Delay(0.2)")] = Delay(0.0)
    ageing: Annotated[
        AgeingModel | None, Part("an ageing model, such as Langevin(rate=1.5), or None")
    ] = None
    activation: Annotated[
        ActivationModel | None,
        Part(
            "a kind of thermal activation, such as Bell(width=0.01, attempts=1e6), or "
            "None"
        ),
    ] = None
    sliding_force: Annotated[
        float,
        Number("f_s", at_least=0, hint="force of a detached contact while it slides"),
    ] = 0.0
    newborn: Annotated[
        Distribution | None,
        Part(
            "a distribution of stretchings, such as Uniform(low=0.0, high=0.2), or None"
        ),
    ] = None
    slip_to_slip_scatter: Annotated[
        float,
        Number(at_least=0, at_most=1, hint="standard deviation of a common factor"),
    ] = 0.0
    areas: Annotated[
        Areas | None,
        Part("areas of contacts, such as Areas(Exponential(mean=1.0), kept=True)"),
    ] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.thresholds is None) == (self.areas is None):
            raise InputError(
                f"Interface.thresholds = {self.thresholds} and areas = {self.areas}: "
                "give one of them, such as thresholds=Gaussian(mean=1.0, std=0.1)",
                "Interface.thresholds",
            )
        if not isinstance(self.activation, Activation | None):
            object.__setattr__(self, "activation", self.activation.form())
        name = "thresholds" if self.areas is None else "areas"
        place = f"Interface.{name}"
        median = float(self.threshold_distribution.inverse_survival(0.5))
        # solvers take small numbers to be small relative to x_s
        if not _SIZES[0] <= median <= _SIZES[1]:
            raise InputError(
                f"{place} = {getattr(self, name)}: half of them lie below "
                f"{median:.3g} x_s; lengths are in "
                "units of x_s, the breaking displacement: divide by it, or read the "
                "rig from a file with SI units",
                place,
            )
        known = {"ageing": FixedGrowth | None, "activation": Barrier | None}
        for name, kinds in known.items():
            given = getattr(self, name)
            if self.areas is not None and not isinstance(given, kinds):
                raise InputError(
                    f"Interface.areas = {self.areas!r}: not available with {name} = "
                    f"{given}; leave one of them out"
                )
        if self.newborn is not None and isinstance(self.ageing, TabulatedGrowth):
            raise InputError(
                f"Interface.newborn = {self.newborn}: not available with ageing = "
                f"{self.ageing}; leave one of them out",
                "Interface.newborn",
            )
        strongest = self.threshold_distribution.support[1]
        largest = strongest if self.areas is None else math.sqrt(strongest)
        for name in ("initial", "newborn"):
            if (born := getattr(self, name)) is None:
                continue
            above, below = born.survival([largest, -largest])
            if (lost := float(above + 1.0 - below)) > 1e-3:
                raise InputError(
                    f"Interface.{name} = {born}: {100 * lost:.3g} % of the contacts "
                    "would start beyond the "
                    f"largest threshold ({strongest:g}); narrow it or bring it nearer "
                    "to 0",
                    f"Interface.{name}",
                )

    @property
    def mechanisms(self) -> frozenset[str]:
        """Names of the interface's mechanisms beyond thresholds and a delay: names of
        fields, or ``on_arrest``.
        """
        fields = {name for name in _MECHANISMS if getattr(self, name)}
        return frozenset(
            fields | {"on_arrest"} if isinstance(self.delay, OnArrest) else fields
        )

    def allow(
        self,
        mechanisms: Collection[str],
        who: str,
        otherwise: str = ", or simulate",
    ) -> None:
        """Raise `InputError` if the interface has a mechanism that is not among the
        `mechanisms` that `who` supports.
        """
        for name in sorted(self.mechanisms.difference(mechanisms)):
            field = "delay" if name == "on_arrest" else name
            raise InputError(
                (
                    f"Interface.{field} = {getattr(self, field)!r}: not available with "
                    f"{who}; leave it out{otherwise}"
                ),
                f"Interface.{field}",
            )

    @cached_property
    def threshold_distribution(self) -> Distribution:
        """Distribution of the threshold forces, conditioned on positive values, as all
        solvers use it; with `areas`, the distribution of the areas.
        """
        forces = self.thresholds if self.areas is None else self.areas.distribution
        assert forces is not None
        return forces.positive()

    @property
    def keeps_areas(self) -> bool:
        """Whether contacts differ in area and each keeps its own."""
        return self.areas is not None and self.areas.kept
