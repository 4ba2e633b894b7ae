"""Rate-and-state friction: the two laws, with their spring-slider motion, small-step
response and critical stiffness.
"""

import math
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from numpy.typing import ArrayLike

from stickslip.errors import UndecidedError, number, numbers, refused, series
from stickslip.measure.trace import Array
from stickslip.model.records import Number, Record

Law = Literal["ageing", "slip"]
LAWS: tuple[Law, ...] = ("ageing", "slip")


def laws_named(law: object) -> tuple[Law, ...]:
    """Return the law of a name, or all for ``"best"``."""
    found = tuple(one for one in LAWS if isinstance(law, str) and law in ("best", one))
    if not found:
        raise refused("law", law, "must be 'best', 'ageing' or 'slip'")
    return found


@dataclass(frozen=True, kw_only=True)
class RateAndState(Record):
    """Friction by rate and state: ``F = F0 + a ln(V/V0) + b ln(V0 theta/D)``.

    Parameters
    ----------
    law : {"ageing", "slip"}
        Evolution of the state: ``theta' = 1 - V theta/D`` (Dieterich), or
        ``-(V theta/D) ln(V theta/D)`` (Ruina).
    a, b : float
        Direct and evolution effect, in the unit of the friction.
    distance : float
        ``D``, in the unit of displacement.
    """

    law: Law
    a: Annotated[float, Number("f_s", above=0, hint="direct effect")]
    b: Annotated[float, Number("f_s", at_least=0, hint="evolution effect")]
    distance: Annotated[
        float, Number("x_s", above=0, hint="distance D over which the state evolves")
    ]

    def critical_stiffness(self, contact_stiffness: float = math.inf) -> float:
        """Return the stiffness below which steady sliding of a massless slider is
        unstable; 0 if it never is.

        It is ``(b - a)/D`` or, with the spring of the contacts in series,
        ``1/(D/(b - a) - 1/k_c)``.
        """
        if self.b <= self.a:
            return 0.0
        spring = number("contact_stiffness", contact_stiffness, above=0, infinite=True)
        softness = self.distance / (self.b - self.a) - 1.0 / spring
        return 1.0 / softness if softness > 0 else math.inf

    def slide(self, time: ArrayLike, velocity: ArrayLike, *, stiffness: float) -> Array:
        """Return the motion of a massless slider from steady sliding: its friction
        minus that at the start, its velocity, and its state ``theta``.

        Parameters
        ----------
        time : array_like, shape (n,)
            Rising times.
        velocity : array_like, shape (n,)
            Velocity of the driven end of the spring, from each time to the next; 0 in a
            hold.
        stiffness : float
            Stiffness of the spring, friction per displacement.

        Raises
        ------
        UndecidedError
            If the slider runs away. With the slip law, it may do so after a large step
            even on a spring stiffer than critical.

        Examples
        --------
        >>> from stickslip.rate_state import RateAndState
        >>> law = RateAndState(law="ageing", a=0.005, b=0.01, distance=10.0)
        >>> time = np.arange(0.0, 41.0)
        >>> friction, _, _ = law.slide(
        ...     time, np.where(time < 10, 1.0, 10.0), stiffness=1e-3
        ... )
        >>> print(f"{0.6 + friction[11]:.8f}")
        0.60720485
        """
        from stickslip.kernels import rate_state as kernel

        t, pull = series("time, velocity", time, velocity)
        start = number(
            "velocity[0]", float(pull[0]), above=0, hint="steady sliding at the start"
        )
        k = number("stiffness", stiffness, above=0, hint="friction per displacement")
        kind = kernel.AGEING if self.law == "ageing" else kernel.SLIP
        try:
            friction, speed, state = kernel.slide(
                kind,
                self.a,
                self.b,
                self.distance,
                k,
                t,
                pull,
                1e-11,
            )
        except RuntimeError as error:
            raise UndecidedError(f"{self}: {error}") from None
        if np.isnan(friction[-1]):
            gone = t[int(np.argmax(np.isnan(friction)))]
            raise UndecidedError(
                f"{self}: on a spring of {k:.4g} the slider runs away before time "
                f"{gone:.4g} "
                f"(critical stiffness {self.critical_stiffness():.4g}); give a stiffer "
                "spring"
            )
        return np.array(
            [
                friction,
                start * np.exp(speed),
                self.distance / start * np.exp(state),
            ]
        )

    def step(self, slip: ArrayLike, ratio: float, *, stiffness: float) -> Array:
        """Return the change of the friction after a step of the velocity by a factor,
        over the displacement of the load point; 0 before the step.
        """
        x = numbers("slip", slip)
        ratio = number("ratio", ratio, above=0, hint="of the velocities")
        found = np.zeros_like(x)
        later, place = np.unique(x[x > 0], return_inverse=True)
        if later.size:  # with the velocity before the step as the unit of velocity
            time = np.concatenate([[-1.0, 0.0], later / ratio])
            found[x > 0] = self.slide(
                time, np.where(time < 0, 1.0, ratio), stiffness=stiffness
            )[0, 2:][place]
        return found

    def small_step(self, slip: ArrayLike, *, stiffness: float) -> Array:
        """Return the change of the friction after a small step of the velocity, over
        ``ln`` of the velocity ratio, which is the same for both laws.

        It is the inverse transform of ``k G/(q (k + q G))`` with
        ``G = a - b/(1 + q D)``.
        """
        x = numbers("slip", slip, at_least=0)
        k = number("stiffness", stiffness, above=0, hint="friction per displacement")
        level = self.a - self.b
        damped = self.a * self.distance
        poles = np.roots([damped, k * self.distance + level, k]).astype(complex)
        if abs(poles[0] - poles[1]) < 1e-9 * abs(poles[0]):
            poles[0] *= 1.0 + 1e-6
        found = np.full(x.shape, complex(level))
        for pole, other in (poles, poles[::-1]):
            with np.errstate(over="ignore"):
                found += (
                    k
                    * (level + damped * pole)
                    / (damped * pole * (pole - other))
                    * np.exp(pole * x)
                )
        return found.real

    def __str__(self) -> str:
        return (
            f"{self.law} law, a = {self.a:.4g}, b = {self.b:.4g}, D = "
            f"{self.distance:.4g}"
        )
