"""The noise of N contacts: fluctuations of a rig in stable smooth sliding, because the
number of its contacts is finite.

In steady sliding the force of each contact is a renewal process: it is pulled, breaks,
waits for its delay and starts anew, with the spectrum ``S_1``
(`stickslip.sliding.response.Unperturbed.noise`). Contacts break independently, and the
slider responds to their sum linearly,

    S_X(w) = S_1(w)/(N |Z(i w) + kappa(i w)|^2),   variance = (1/pi) Int_0^inf S dw

per contact; the spring force is ``K`` times the displacement. The result is not in the
paper; it is the leading order in ``1/N``.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.answers import Answer, plain
from stickslip.arrays import Array, labelled
from stickslip.errors import InputError, UndecidedError, number
from stickslip.loops import HALVINGS, bounded
from stickslip.model.distribution import nodes_between
from stickslip.model.methods import DRAWN, Contacts
from stickslip.model.rig import Rig
from stickslip.model.structure import Structure
from stickslip.sliding import kinetic_friction
from stickslip.sliding.response import Fluctuations, whole_axis
from stickslip.stability import modes, roots
from stickslip.stability.impedances import is_plain
from stickslip.stability.scan import SmoothSliding
from stickslip.words import number as digits

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

# relative error of each variance at which a panel is not halved further, and of the
# parts beyond the ends
_LOST = 1e-5
# octaves of the frequency in units of one over the mean cycle of a contact
_OCTAVES = np.arange(-44.0, 45.0)
_PANELS = 1 << 15  # most panels at once: with more, halving resolves only rounding
_NODE = np.polynomial.legendre.leggauss(16)[0]
# a rule on every other node of `nodes_between`: where it is accurate enough, the rule
# on all nodes is accurate
_ROUGH = np.zeros(16)
_ROUGH[::2] = np.linalg.solve(
    np.polynomial.legendre.legvander(_NODE[::2], 7).T, 2.0 * np.eye(8)[0]
)
# relative error of the fluctuations in a run of recommended length
_ERROR = 0.05
# frequency, in the same unit, below which the noise is white and kappa proportional to
# the frequency
_SLOWEST = 1e-4


@dataclass(frozen=True, kw_only=True, repr=False)
class ContactNoise(Answer):
    """Fluctuations of smooth sliding by the noise of N contacts, in the rig's own
    units.
    """

    contacts: int  #: number of contacts ``N``
    spring_force: float  #: root mean square of its deviations from the mean
    velocity: float  #: root mean square of the slider's deviations from the mean
    mean_spring_force: float
    mean_velocity: float  #: equal to that of the drive

    #: Correlation time of the spring force: the integral of the square of its
    #: correlation. A run of time ``T`` holds ``T/memory`` independent deviations; for a
    #: mode that decays at the rate ``g`` it is ``1/(2 g)``.
    memory: float

    rig: Rig = field(compare=False)  #: the rig with this noise

    # frequencies, and the spectra of force and velocity there, in the rig's own units
    _spectra: tuple[Array, Array, Array] = field(compare=False)

    @cached_property
    def spectrum(self) -> "xr.Dataset":
        """One-sided spectra of force and velocity along ``frequency``, in Hz (cycles
        per time in natural units): their integrals are the squares of the deviations.
        """
        import xarray as xr

        rig = self.rig
        hertz, per = ("Hz", " / Hz") if rig.scales is not None else ("1/time", " time")
        frequency, spring_force, velocity = self._spectra
        found = {}
        for name, unit, value in (
            ("spring_force", "f_s", spring_force),
            ("velocity", "x_s/time", velocity),
        ):
            title = f"spectrum of the {name.replace('_', ' ')}"
            found[name] = labelled(
                title,
                "frequency",
                value,
                f"({rig.unit_name(unit)})^2{per}",
            )
        return xr.Dataset(
            found, {"frequency": labelled("frequency", "frequency", frequency, hertz)}
        )

    @property
    def relative_force(self) -> float:
        """Root mean square of the spring force over its mean."""
        return self.spring_force / self.mean_spring_force

    @property
    def relative_velocity(self) -> float:
        """Root mean square deviation of the slider's velocity from the drive's, over
        the drive's.
        """
        return self.velocity / self.mean_velocity

    @property
    def linear(self) -> bool:
        """Whether linear theory applies: the root mean square deviation of the slider's
        velocity is less than its mean.

        Above that it sometimes stops and moves back, where contacts do not respond as
        to a small perturbation.
        """
        return self.relative_velocity < 1.0

    @cached_property
    def growth_rate(self) -> float:
        """Growth rate of the slowest mode, below 0, as in `stability.growth_rate`; NaN
        where no mode decays exponentially.

        A run from a steady state has reached the noise when this times its length is
        below about -10.
        """
        try:
            return modes.growth_rate(self.rig).real
        except UndecidedError:
            return math.nan

    def contacts_for(self, fraction: float, *, of: str = "force") -> int:
        """Return the number of contacts from which on the noise is below a fraction of
        the mean.

        Parameters
        ----------
        fraction : float
            Root mean square over the mean; 0.05 is 5 %.
        of : {"force", "velocity"}
            The spring force, or the slider's velocity.

        Raises
        ------
        InputError
            If the fraction is not above 0, or `of` is neither.
        """
        relative = {"force": self.relative_force, "velocity": self.relative_velocity}
        if of not in list(relative):
            raise InputError(
                f"contacts_for: of = {of!r}: must be 'force' or 'velocity'"
            )
        most = number("contacts_for: fraction", fraction, above=0, hint="0.05 for 5 %")
        return max(math.ceil(self.contacts * (relative[of] / most) ** 2), 1)

    def error(self, duration: float) -> float:
        """Return the relative standard error of the root mean square of the spring
        force in one run of a given duration.

        Raises
        ------
        InputError
            If the duration is not above 0.
        """
        return math.sqrt(
            0.5 * self.memory / number("error: duration", duration, above=0)
        )

    def __str__(self) -> str:
        rig = self.rig
        part = self.relative_velocity
        natural = (
            (self.spring_force, "f_s"),
            (self.velocity, "x_s/time"),
            (self.memory / _ERROR**2 / 2.0, "time"),
        )
        force, velocity, run = (
            rig.in_units(value / rig.unit(unit), unit, 2) for value, unit in natural
        )
        by = _percent(part) if self.linear else f"{digits(part, 2)} times the drive's"
        lines = [
            f"smooth sliding with {self.contacts} contacts: the spring force "
            "fluctuates by "
            f"{_percent(self.relative_force)} of its mean ({force} rms), the velocity "
            f"by {by} ({velocity} rms)",
            (
                "below 5 % of the mean spring force from "
                f"{digits(self.contacts_for(0.05), 3)} contacts on"
            ),
            f"a run of {run} shows the size of the fluctuations to {_percent(_ERROR)}",
        ]
        if not self.linear:
            least = digits(self.contacts_for(1.0, of="velocity"), 3)
            lines.append(
                "beyond linear theory: where the velocity fluctuates by more than the "
                "drive's, the slider stops; "
                f"theory holds from {least} contacts on"
            )
        return "\n".join(lines)

    def to_dict(self) -> dict[str, Any]:
        """Return the numbers, in the rig's own units, without the spectrum."""
        named = [
            name
            for name in self.__dataclass_fields__
            if name not in ("rig", "_spectra")
        ]
        named += ["relative_force", "relative_velocity", "linear"]
        found: dict[str, Any] = plain({name: getattr(self, name) for name in named})
        return found | {"contacts_for_5_percent": self.contacts_for(0.05)}

    def plot(self) -> "Figure":
        """Draw both spectra."""
        import matplotlib.style
        from matplotlib.figure import Figure

        # the style is found by name, as plotting is a layer above
        with matplotlib.style.context("stickslip.plot.house"):
            figure = Figure(figsize=(7.0, 2.6), layout="constrained")
            for ax, name in zip(
                figure.subplots(1, 2),
                ("spring_force", "velocity"),
                strict=True,
            ):
                draw: Any = self.spectrum[name].plot
                draw(ax=ax, xscale="log", yscale="log")
                ax.set_ylim(bottom=1e-8 * float(self.spectrum[name].max()))
        return figure


def _percent(part: float) -> str:
    return f"{digits(100.0 * part, 2)} %"


def contact_noise(rig: Rig, *, contacts: int | None = None) -> ContactNoise:
    """Return the fluctuations of the spring force and the slider's velocity in smooth
    sliding with N contacts.

    This is linear theory, without a run: each contact is pulled, breaks and re-attaches
    at random, and the slider responds to their sum. So even a stable rig oscillates,
    and more so near its stability limit.

    Parameters
    ----------
    rig : Rig
        Interface, slider (a structure, or an impedance with a spring) and velocity.
    contacts : int, optional
        Number of contacts ``N``; by default that of the rig's method.

    Returns
    -------
    ContactNoise
        Root mean squares in the rig's own units, spectra, and their range of validity.

    Raises
    ------
    InputError
        If smooth sliding is unstable, or there is none; if the rig's method has no
        number of contacts and none is given; if the slider is elastic, or has no mass;
        if contacts differ in area, re-attach with stretchings that scatter, or age by a
        user's own rule.
    UndecidedError
        If smooth sliding is neutral to within rounding.

    Examples
    --------
    >>> interface = ss.Interface(
    ...     thresholds=ss.Gaussian(mean=1.0, std=0.2), delay=ss.Delay(0.1)
    ... )
    >>> slider = ss.Slider(stiffness=2.0, mass=1e-3, damping=40.0)
    >>> noise = ss.stability.contact_noise(
    ...     ss.Rig(interface, slider, ss.constant(1.0)), contacts=1000
    ... )
    >>> print(f"{noise.relative_force:.4f} {noise.contacts_for(0.01)}")
    0.0227 5165
    """
    sliding = modes.smooth_sliding(rig)
    _, body, velocity = sliding
    method = rig.method if contacts is None else Contacts(contacts)
    stiffness = getattr(body, "stiffness", 0.0)
    if not isinstance(method, DRAWN):
        raise InputError(
            f"contact_noise: contacts: the rig's method, {method}, stands for "
            "infinitely many, without noise; "
            "give their number, such as contacts=1000"
        )
    structure = body if isinstance(body, Structure) else None
    if not (structure or stiffness > 0):
        raise InputError(
            f"Rig.slider = {body!r}: no driving spring, whose force could be measured; "
            "give it a stiffness"
        )
    if growing := roots.count(sliding):
        raise InputError(
            "contact_noise: smooth sliding at velocity "
            f"{rig.in_units(velocity, 'x_s/time')} is unstable, with "
            f"{growing} growing modes: the rig leaves it, however many its contacts; "
            "simulate(rig) shows for what"
        )
    # a body that is not a plain record may not be hashable
    known: Any = _spectrum if is_plain(body) else _spectrum.__wrapped__
    omega, weight, displaced = known(sliding)
    moved = omega**2 * displaced
    stretched = _pulls(structure, omega) if structure else stiffness**2
    pulled = stretched * displaced
    whole, square, fast = (
        float(weight @ each) / math.pi for each in (pulled, pulled**2, moved)
    )
    memory = square / whole**2
    friction = kinetic_friction(rig.interface, velocity)
    if structure:
        state, place = structure.sliding(velocity, friction)
        mean = structure.pull.force(state, place, velocity)
    else:
        slow = 1e-6 / memory
        drag = velocity / slow * float(body(np.array([1j * slow]))[0].imag)
        mean = friction + drag
    force, speed, time = (rig.unit(unit) for unit in ("f_s", "x_s/time", "time"))
    count = method.count
    per_hertz = 2.0 * time / count
    return ContactNoise(
        contacts=count,
        spring_force=force * math.sqrt(whole / count),
        velocity=speed * math.sqrt(fast / count),
        mean_spring_force=force * mean,
        mean_velocity=speed * velocity,
        memory=time * memory,
        rig=rig,
        _spectra=(
            omega / (2.0 * math.pi * time),
            force**2 * per_hertz * pulled,
            speed**2 * per_hertz * moved,
        ),
    )


def _pulls(structure: Structure, omega: Array) -> Array:
    """Return the square of the pulling force over the displacement of the contacts."""
    A, force, _, _, contact, _ = structure.system
    shifted = 1j * omega[:, None, None] * np.eye(len(A)) - A
    states = np.linalg.solve(shifted, force[None, :, None])[..., 0]
    return np.asarray(
        np.abs(states @ structure.pull.state) ** 2 / np.abs(states @ contact) ** 2
    )


def _fluctuations_of(sliding: SmoothSliding) -> Callable[[Array], Fluctuations]:
    """Return fluctuations as a function of frequencies, from a table where they are
    expensive.
    """
    response, _, velocity = sliding
    lowest = _SLOWEST / sliding.scales.cycle
    highest = math.inf
    if response.certain:

        def between(omega: Array) -> Fluctuations:
            return response.fluctuations(velocity, 1j * omega)
    else:
        known, table = whole_axis(response, velocity)
        lowest = float(known[0])
        highest = float(known[-1])

        def between(omega: Array) -> Fluctuations:
            kappa, noise = table(np.log(omega))
            return Fluctuations(kappa, noise.real)

    def everywhere(omega: Array) -> Fluctuations:
        inside, whose = np.unique(np.clip(omega, lowest, highest), return_inverse=True)
        kappa, noise = between(inside)
        fall = np.minimum(highest / omega, 1.0) ** 2
        return Fluctuations(
            kappa[whose] * np.minimum(omega / lowest, 1.0), noise[whose] * fall
        )

    return everywhere


@lru_cache(maxsize=64)
def _spectrum(sliding: SmoothSliding) -> tuple[Array, Array, Array]:
    """Return frequencies, their weights in an integral, and the spectrum of the
    displacement there for one contact.

    Panels are halved until halving changes neither the variance of the displacement nor
    that of the velocity.
    """
    known = _fluctuations_of(sliding)
    body = sliding.body

    def displaced(omega: Array) -> Array:
        kappa, noise = known(omega.ravel())
        if np.isnan(noise).any() or not noise.any():
            raise InputError(
                "Interface.ageing: the noise of contacts that age by a rule of your "
                "own is not known"
            )
        return np.asarray(
            noise / np.abs(body(1j * omega.ravel()) + kappa) ** 2
        ).reshape(omega.shape)

    octaves = np.exp2(_OCTAVES) / sliding.scales.cycle
    part = octaves * displaced(octaves) * np.stack([np.ones_like(octaves), octaves**2])
    part /= part.max(axis=1, keepdims=True)
    last = int(np.flatnonzero(np.any(part > 0.1 * _LOST, axis=0))[-1])
    if last == octaves.size - 1:
        raise InputError(
            f"Rig.slider = {body!r}: without mass it would jump at each break; give it "
            "one"
        )
    edges = np.append(
        0.0, octaves[int(np.argmax(np.any(part > 0.01, axis=0))) : last + 2]
    )
    left = edges[:-1]
    right = edges[1:]
    kept = []
    total = np.zeros((2, 1))
    turns = bounded("contact_noise: panels", HALVINGS)
    while left.size:
        next(turns)
        omega, weight = nodes_between(left, right)
        value = displaced(omega)
        both = np.stack([value, omega**2 * value])
        fine = np.sum(weight * both, axis=2)
        rough = 0.5 * (right - left) * (both @ _ROUGH)
        sure = np.all(
            np.abs(fine - rough) < _LOST * (total + fine.sum(axis=1, keepdims=True)),
            axis=0,
        )
        sure |= right - left < 1e-13 * right
        total = total + fine[:, sure].sum(axis=1, keepdims=True)
        kept.append(np.stack([omega[sure], weight[sure], value[sure]]).reshape(3, -1))
        middle = 0.5 * (left + right)[~sure]
        if middle.size > _PANELS:
            raise InputError(
                f"Rig.slider = {body!r}: {_PANELS} panels do not resolve the spectrum "
                f"of its motion near w = {middle[0]:.4g}; give it more damping"
            )
        left = np.append(left[~sure], middle)
        right = np.append(middle, right[~sure])
    found = np.concatenate(kept, axis=1)
    return tuple(found[:, np.argsort(found[0])])
