"""The interface: the properties of its contacts."""

import math
from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Literal

from stickslip.errors import InputError
from stickslip.model.activation import Activation, ActivationModel, Barrier
from stickslip.model.ageing import AgeingModel, FixedGrowth
from stickslip.model.delays import Delay, DelayModel, OnArrest
from stickslip.model.distributions import Distribution, Gaussian
from stickslip.model.records import Number, Part, Record

_SIZES = 1e-3, 1e3  # in ``x_s``, between which the median of the thresholds must lie


@dataclass(frozen=True, kw_only=True)
class Interface(Record):
    """An interface made of many contacts.

    Parameters
    ----------
    thresholds : Distribution
        Distribution of the stretchings at which contacts break, ``P_c``; conditioned on
        positive values by the solvers. Half of them lie below some value between 0.001
        and 1000: lengths are in units of ``x_s``.
    initial : Distribution
        Distribution of the stretchings at the start, ``Q(x; X=0)``; a contact that
        starts at ``x_0`` has a threshold beyond ``|x_0|``. `SteadyState` starts from
        the distribution of smooth sliding.
    delay : DelayModel
        How long a broken contact stays detached.
    ageing : AgeingModel, optional
        How thresholds grow with the age of a contact; by default they do not.
    temperature : ActivationModel, optional
        How contacts break before their threshold, a `Bell`, `Parabolic` or `Barrier`;
        by default they do not.
    sliding_force : float
        Force ``f_d`` of a detached contact while it slides, in ``f_s``, against the
        motion. Detached contacts slide together: where the slider turns round they
        follow it elastically, with their stiffness ``k``, until the force is ``f_d``
        the other way.
    newborn : Distribution, optional
        Distribution of the stretchings with which contacts re-attach, along the motion
        of the slider; by default they are unstretched. Like a contact of the start, one
        that re-attaches at ``x_0`` has a threshold beyond ``|x_0|``.
        ``Gaussian(mean=f_d, std=0.0)`` re-attaches them as they slide.
    track_scatter : float
        Scatter from slip to slip of all thresholds alike: the standard deviation of the
        factor, of mean 1, that the thresholds drawn between two arrests of the slider
        have in common. The factor is log-normal, as the strength of a track is the
        product of many influences: it is positive, and half as strong is as likely as
        twice. Of contacts of different areas it is the areas that have it in common,
        with "site" those of the contacts that attach then.
    areas : {"fresh", "site"}, optional
        Contacts of different areas ``a``: `thresholds` is then the distribution of
        areas, in units of one whose threshold force and stiffness are 1. The threshold
        force goes with the area and the stiffness with its root, ``f_s = a`` and
        ``k = sqrt(a)``, so that a contact breaks at the stretching ``sqrt(a)``. With
        "fresh" a contact draws a new area whenever it re-attaches, with "site" it keeps
        its own; for exponential areas the force with "fresh" is 1.5 times that with
        "site". Threshold forces grow with age by the rule of `ageing`; `sliding_force`
        is that of a detached contact of any area. Steady sliding is known in closed
        form, runs take `Contacts`. By default all contacts are equally stiff.
    """

    thresholds: Annotated[
        Distribution, Part("a distribution, such as Gaussian(mean=1.0, std=0.1)")
    ]
    initial: Annotated[
        Distribution, Part("a distribution, such as Gaussian(mean=0.0, std=0.01)")
    ] = Gaussian(0.0, 0.01)
    delay: Annotated[DelayModel, Part("a delay, such as Delay(0.2)")] = Delay(0.0)
    ageing: Annotated[
        AgeingModel | None, Part("an ageing model, such as Langevin(rate=1.5), or None")
    ] = None
    temperature: Annotated[
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
    track_scatter: Annotated[
        float,
        Number(at_least=0, at_most=1, hint="standard deviation of a common factor"),
    ] = 0.0
    areas: Literal["fresh", "site"] | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if not isinstance(self.temperature, Activation | None):
            object.__setattr__(self, "temperature", self.temperature.form())
        median = float(self.threshold_distribution.inverse_survival(0.5))
        # what solvers call small is small beside x_s
        if not _SIZES[0] <= median <= _SIZES[1]:
            raise InputError(
                f"Interface.thresholds = {self.thresholds}: half of them lie below "
                f"{median:.3g} x_s; lengths are in "
                "units of x_s, the breaking displacement: divide by it, or read the "
                "rig from a file with SI units",
                "Interface.thresholds",
            )
        for name, kinds in {
            "ageing": FixedGrowth | None,
            "temperature": Barrier | None,
        }.items():
            if self.areas is not None and not isinstance(
                given := getattr(self, name), kinds
            ):
                raise InputError(
                    f"Interface.areas = {self.areas!r}: not available with {name} = "
                    f"{given}; leave one of them out"
                )
        strongest = self.threshold_distribution.support[1]
        largest = strongest if self.areas is None else math.sqrt(strongest)
        for name, born in (("initial", self.initial), ("newborn", self.newborn)):
            above, below = (
                born.survival([largest, -largest]) if born is not None else (0.0, 1.0)
            )
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
        """Names of the mechanisms beyond thresholds and a delay that the interface
        has; each is a field of its own.
        """
        asked = {
            "ageing": self.ageing is not None,
            "temperature": self.temperature is not None,
            "sliding_force": self.sliding_force > 0,
            "newborn": self.newborn is not None,
            "track_scatter": self.track_scatter > 0,
            "areas": self.areas is not None,
            "on_arrest": isinstance(self.delay, OnArrest),
        }
        return frozenset(name for name, present in asked.items() if present)

    def allow(self, mechanisms: Collection[str], who: str) -> None:
        """Raise `InputError` if the interface has a mechanism that is not among
        those that `who` can take.
        """
        for name in sorted(self.mechanisms.difference(mechanisms)):
            field = "delay" if name == "on_arrest" else name
            raise InputError(
                (
                    f"Interface.{field} = {getattr(self, field)!r}: not available with "
                    f"{who}; leave it out, or simulate"
                ),
                f"Interface.{field}",
            )

    @cached_property
    def threshold_distribution(self) -> Distribution:
        """The distribution of thresholds conditioned on positive values, as every
        solver uses it.
        """
        return self.thresholds.positive()
