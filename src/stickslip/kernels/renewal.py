"""The master equation under rigid motion, Eqs. (1)-(4), solved as a renewal process by
fast convolution.

When the slider is moved at a given velocity, each contact is independent: attached at
``x = 0``, it breaks at its threshold and re-attaches a distance ``s = v tau_d`` further
on. With ``m(X)`` the number of breaks per contact up to ``X``, which is continuous even
where the breaking rate jumps, the master equation is one Volterra equation::

    m(X) = m_0(X) + Int_0^X P~(x) m(X - x) dx,
    P~(x) = mean over delays of P_c(x - s)

``m_0`` counts the first breaks of the initial contacts; it is known in closed form. The
unknown is taken piecewise linear and each kernel is integrated exactly against it: its
weights are the second differences of its second antiderivative, which consists of
``excess(x, n)``, the survival function integrated `n` times from above. So jumps of the
density do not reduce the order: the scheme is second order for every distribution of
bounded density, and Richardson extrapolation over three grids makes it sixth order for
smooth ones.

Contacts that re-attach stretched by ``x_0``, with a threshold beyond ``|x_0|``, break
after a displacement ``x_s - x_0``: the distribution of these displacements, a mean over
nodes of ``x_0``, replaces that of thresholds.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from .records import Floats

NOTHING = 1e-18  # survival below which a distribution is taken to have ended

Density = Callable[[Floats], Floats]
Excess = Callable[[Floats, int], Floats]


class RenewalContacts(NamedTuple):
    """The contacts at the start and their thresholds and delays."""

    density: Density  # ``P_c(x)`` at ``x >= 0``
    # ``excess(x, n)``: mean of ``max(x_s - x, 0)**n / n!``, for n = 0, 1, 2; order 0 is
    # ``J_c``
    excess: Excess
    stretching: Floats  # nodes of the initial stretchings, any sign
    weight: Floats  # of sum 1
    # thresholds lie beyond: ``|x_0|``, or ``max(x_0, 0)`` where Eq. (3) is taken
    # literally
    reach: Floats
    # distances ``v tau_d >= 0`` travelled before a broken contact re-attaches; 0: at
    # once; empty: never
    shift: Floats
    fraction: Floats  # of sum 1
    born: Floats = np.zeros(1)  # nodes of the stretchings at re-attachment
    born_weight: Floats = np.ones(1)  # of sum 1


class ReAttached(NamedTuple):
    """Contribution of all contacts except the initial ones: continuous functions on a
    uniform grid from 0.
    """

    spacing: float  # between points
    # shape (4, n): force, attached fraction, breaking rate and stiffness
    values: Floats


class RigidResponse(NamedTuple):
    """The interface under rigid motion, per contact."""

    force: Floats  # ``F_c/N`` in units of ``f_s``, Eq. (4)
    attached: Floats  # fraction
    rate: Floats  # breaks per contact and unit displacement, ``Gamma(X)`` of Eq. (2)
    # ``dF_c/dX`` = attached - Int x P Q dx, plus the force of contacts that attach; no
    # numerical derivative
    stiffness: Floats


def solve(contacts: RenewalContacts, distance: float, points: int) -> ReAttached:
    """Solve for the contacts that break and re-attach from 0 to a distance, on a grid
    of `points` intervals and two finer ones.
    """
    X = np.linspace(0.0, distance, points + 1)
    spacing = distance / points
    finest = np.linspace(0.0, distance, 4 * points + 1)
    first = 1.0 - _initial(contacts, finest).attached
    coarse, middle, fine = (
        solve_once(contacts, first[:: 4 // every], distance)[:, ::every]
        for every in (1, 2, 4)
    )
    broken, travelled, rate, force, stiffness = (coarse - 20 * middle + 64 * fine) / 45
    if contacts.shift.size == 1 and contacts.shift[0] == 0:
        back = broken
        stretched = travelled
    else:
        # A delay is in general no multiple of the spacing: a shift before the
        # extrapolation would spoil it by the corner at X = s.
        back = np.zeros_like(X)
        stretched = np.zeros_like(X)
        for shift, fraction in zip(contacts.shift, contacts.fraction, strict=True):
            later = shift <= X
            where = (X[later] - shift) / spacing
            back[later] += fraction * _interpolate(broken, where)
            stretched[later] += fraction * _interpolate(travelled, where)
    # Contacts of the initial breaks that re-attach at once are left to `observe`, which
    # computes them without interpolation.
    once = _at_once(contacts)
    attached = back - broken + (1.0 - once) * first[::4]
    force = stretched - force + _carried(contacts) * (back - once * first[::4])
    return ReAttached(spacing, np.stack([force, attached, rate, back - stiffness]))


def _carried(contacts: RenewalContacts) -> float:
    """Return the mean stretching at re-attachment."""
    return float(contacts.born_weight @ contacts.born)


def observe(
    contacts: RenewalContacts,
    re_attached: ReAttached,
    X: Floats,
) -> RigidResponse:
    """Evaluate force, attached fraction, breaking rate and stiffness at any positions
    up to the distance of `solve`.

    The contribution of the initial contacts is closed-form at every `X`; the rest is
    continuous and interpolated to sixth order. A one-sided limit at a jump of the
    density is the value at the next number on that side (``numpy.nextafter``).
    """
    initial = _initial(contacts, X)
    force, attached, rate, stiffness = _interpolate(
        re_attached.values, X / re_attached.spacing
    )
    once = _at_once(contacts)
    carried = _carried(contacts)
    breaking = initial.rate + rate
    broken = 1.0 - initial.attached
    stiffness += initial.stiffness
    if carried:
        stiffness += carried * re_attaching(contacts, re_attached, X, breaking)
    force += initial.force + carried * once * broken
    return RigidResponse(
        force,
        1.0 - (1.0 - once) * broken + attached,
        breaking,
        stiffness,
    )


def re_attaching(
    contacts: RenewalContacts,
    re_attached: ReAttached,
    X: Floats,
    breaking: Floats,
) -> Floats:
    """Return the contacts that re-attach per contact and unit displacement: the
    breaking rate one delay earlier, averaged over delays.
    """
    total = np.zeros_like(breaking)
    for shift, fraction in zip(contacts.shift, contacts.fraction, strict=True):
        if shift == 0:
            total += fraction * breaking
            continue
        later = shift <= X
        earlier = X[later] - shift
        rate = _interpolate(re_attached.values[2], earlier / re_attached.spacing)
        total[later] += fraction * (_initial(contacts, earlier).rate + rate)
    return total


def _initial(contacts: RenewalContacts, X: Floats) -> RigidResponse:
    """Return the contribution of the initial contacts until they first break."""
    known = contacts.reach[:, None]
    values = np.zeros((4, X.size))
    scale = (contacts.weight / contacts.excess(contacts.reach, 0))[:, None]
    # only where some are still attached
    inside = np.flatnonzero(X + contacts.stretching.min() < _end(contacts))
    # parts so small that a table by node of the start takes some 10 MB
    size = max(1_000_000 // contacts.stretching.size, 1)
    for part in (inside[begin : begin + size] for begin in range(0, inside.size, size)):
        x = contacts.stretching[:, None] + X[part]
        reached = np.maximum(x, known)
        survivors = scale * contacts.excess(reached, 0)
        breaking = np.where(x >= known, scale * contacts.density(reached), 0.0)
        values[0, part] = np.sum(x * survivors, axis=0)
        values[1, part] = np.sum(survivors, axis=0)
        values[2, part] = np.sum(breaking, axis=0)
        values[3, part] = np.sum(survivors - x * breaking, axis=0)
    return RigidResponse(*values)


def _end(contacts: RenewalContacts) -> float:
    """Return a stretching beyond all thresholds.

    Not to evaluate the distribution beyond it saves most of the evaluations.
    """
    x = np.asarray(2.0 ** np.arange(-30, 60))
    gone = x[contacts.excess(x, 0) < NOTHING]
    return float(max(gone[0] if gone.size else np.inf, 2.0 * contacts.reach.max()))


def _at_once(contacts: RenewalContacts) -> float:
    """Return the fraction of broken contacts that re-attaches without delay."""
    return float(contacts.fraction[contacts.shift == 0].sum())


def solve_once(contacts: RenewalContacts, first: Floats, distance: float) -> Floats:
    """Return the second-order solution on the uniform grid on which the first breaks
    ``m_0`` are given.

    Rows: breaks ``m``, their integral over X, and the convolutions of the breaks with
    the kernels of the breaking rate, of the force lost and of the stiffness lost by
    contacts that break (``J - 1`` in place of ``J``).
    """
    n = first.size
    h = distance / (n - 1)
    antiderivatives = np.zeros((4, n + 1))
    end = _end(contacts)
    for shift, fraction in zip(contacts.shift, contacts.fraction, strict=True):
        later = slice(int(shift // h), None)
        x = np.maximum(h * np.arange(n + 1)[later] - shift, 0.0)
        antiderivatives[:, later] += fraction * _antiderivatives(contacts, x, end)
    # Second differences; all antiderivatives vanish up to X = 0.
    weights = np.diff(antiderivatives, n=2, axis=1, prepend=0.0) / h
    # On a circle |z| = r < 1 the division of power series is safe, and terms that wrap
    # around are damped by r**size.
    size = 1 << (4 * n - 1).bit_length()
    damping = np.exp(np.log(WRAPPED) / size * np.arange(n))
    kernels = np.fft.rfft(weights * damping, size)
    breaks = np.fft.rfft(first * damping, size) / (1 - kernels[0])
    spectra = np.concatenate([breaks[None], breaks * kernels[1:]])
    rows = np.fft.irfft(spectra, size)[:, :n] / damping
    broken = rows[0]
    travelled = h * (np.cumsum(broken) - 0.5 * broken)
    return np.stack([broken, travelled, *rows[1:]])


# factor that damps terms that wrap around; rounding errors grow by its fourth root, at
# most
WRAPPED = 1e-13


def _antiderivatives(contacts: RenewalContacts, path: Floats, end: float) -> Floats:
    """Return second antiderivatives, zero where a displacement starts, of the four
    kernels that act on ``m``.

    With `G` the fraction of newborn contacts that has broken after a displacement, and
    ``x G`` the force that it carried: of ``G'`` it is ``Int G`` (breaks of breaks), of
    ``G''`` it is ``G`` (breaking rate), of ``(x G)'`` it is ``Int x G`` (force lost),
    of ``(x G)''`` it is ``x G`` (stiffness lost).
    """
    total = np.zeros((4, path.size))
    # from here on no contact survives
    tail = int(np.searchsorted(path, end - float(contacts.born.min())))
    lost = np.zeros(2)
    for born, weight in zip(
        contacts.born.tolist(),
        contacts.born_weight.tolist(),
        strict=True,
    ):
        held = abs(born)
        at_birth = np.array([held])
        all_held, mean, half_square = (
            float(contacts.excess(at_birth, order)[0]) for order in range(3)
        )
        gone = held + mean / all_held
        work = 0.5 * held * held + (half_square + held * mean) / all_held
        # up to here no threshold is met
        begin = int(np.searchsorted(path[:tail], held - born))
        x = path[begin:tail] + born
        survival, first, second = (
            contacts.excess(x, order) / all_held for order in range(3)
        )
        G = 1.0 - survival
        integral = x - gone + first
        moment = 0.5 * x * x - work + second + x * first
        total[:, begin:tail] += weight * np.stack([integral, G, moment, x * G])
        lost += weight * np.array([gone - born, work - 0.5 * born * born])
    x = path[tail:]
    carried = _carried(contacts)
    total[0, tail:] = x - lost[0]
    total[1, tail:] = 1.0
    total[2, tail:] = x * (0.5 * x + carried) - lost[1]
    total[3, tail:] = x + carried
    return total


def _interpolate(values: Floats, where: Floats) -> Floats:
    """Return values at fractional indices along the last axis, by polynomials through
    the six nearest points.
    """
    count = values.shape[-1]
    degree = min(5, count - 1)
    first = np.clip(np.floor(where).astype(int) - degree // 2, 0, count - 1 - degree)
    offset = where - first
    total = np.zeros(values.shape[:-1] + where.shape)
    for i in range(degree + 1):
        others = [j for j in range(degree + 1) if j != i]
        factors = [(offset - j) / (i - j) for j in others]
        total += np.prod(factors, axis=0) * values[..., first + i]
    return total
