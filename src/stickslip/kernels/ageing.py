"""Contacts whose thresholds age while they live, Eqs. (13)-(18).

Everything is per contact and in natural units (contact stiffness 1). A threshold follows the Langevin equation

    df = rate^2 (mean - f) dt + rate spread sqrt(2) dW,        Eqs. (13), (15), (16)

with ``rate`` the paper's beta, ``mean`` its f_s and ``spread`` its delta f_s. A contact breaks when its stretching
``|x|`` first meets its threshold ``f``; it is reborn at ``x = 0`` with the threshold ``newborn``. The *gap*
``y = f - |x|`` is what is left until it breaks.

With ``newborn = 0`` a contact is born on its own breaking boundary. It then breaks and is reborn infinitely often
before it leaves the boundary for good, as Brownian motion returns to zero: the rate of breaking is infinite, while
force, stretchings and thresholds are finite. All solvers here therefore count *excursions* of the gap from zero, by
its local time there, and never breaks:

- `advance_contacts` samples N contacts;
- `steady_friction` and `steady_moments` solve the stationary kinetic equation, N to infinity;
- `advance_density` solves the kinetic equation with a moving slider;
- `dynamic_stiffness_ageing` linearises it about steady sliding;
- `closure_friction` and `advance_closure` are the paper's own approximation, Eqs. (1)-(3) with (18).
"""

import numpy as np
from numpy.typing import NDArray

from ._jit import jit

Floats = NDArray[np.float64]

# Relaxation times of the reflected gap, noise/drift^2, after which its start is forgotten to exp(-FORGOTTEN/2).
FORGOTTEN = 16.0

# A contact sleeps while the slider goes a third of its gap, and for this share of gap^2/noise: the other two thirds are
# then four standard deviations of its threshold.
SLEEP = (2.0 / 3.0 / 4.0) ** 2

NO_DELAY = np.zeros(1)

# ---------------------------------------------------------------- grids and exponentially fitted rates


@jit
def _bernoulli(z: float) -> float:
    """Bernoulli function ``z / (exp(z) - 1)`` of the Scharfetter-Gummel flux."""
    if abs(z) < 1e-3:
        return 1.0 - 0.5 * z + z * z / 12.0
    if z > 700.0:
        return 0.0
    return z / float(np.expm1(z))


@jit
def _graded(end: float, cells: int, first: float) -> Floats:
    """Nodes from 0 to `end`, spacing `first` at 0 and growing as a sinh; uniform where that is finer."""
    nodes = np.linspace(0.0, end, cells + 1)
    if first < 0.999 * end / cells:
        low, high = 1e-6, 60.0
        for _ in range(60):
            k = 0.5 * (low + high)
            if end * np.sinh(k / cells) / np.sinh(k) > first:
                low = k
            else:
                high = k
        for i in range(cells + 1):
            nodes[i] = end * np.sinh(k * i / cells) / np.sinh(k)
    return nodes


@jit
def _gap_nodes(u: float, delta: float, newborn: float, cells: int) -> Floats:
    """Nodes of the gap in units of the spread, from the boundary to where the density is below 1e-15.

    The drift of the gap at birth is ``c = (1-u)/delta``, in the potential ``z^2/2 - c z``.
    """
    c = (1.0 - u) / delta
    end = c + np.sqrt((c * c if c < 0.0 else 0.0) + 72.0)
    end = max(end, newborn / delta + 8.5)
    layer = 1.0 / max(1.0, abs(c))  # the boundary layer of the drift against the noise
    return _graded(end, cells, 5.0 * layer / cells)


@jit
def _age_nodes(u: float, delta: float, newborn: float, steps: int) -> Floats:
    """Nodes of the age in units of 1/rate^2, from birth to where survivors are fewer than exp(-30).

    Where the drift ``c(a)`` of the gap is negative, survivors decay at least as exp(-int c^2/4 da).
    """
    c, r = (1.0 - u) / delta, u / delta
    if c < 0.0:
        end = ((360.0 * r - c**3) ** (1.0 / 3.0) + c) / r
    else:
        end = c / r + (360.0 / r**2) ** (1.0 / 3.0)
    z = newborn / delta
    if z > 0.0:  # the way down to the boundary, were there no noise
        end += min(np.sqrt(2.0 * z / r), z / max(-c, 1e-9))
    return _graded(end, steps, 2.0 / steps)


@jit
def _chain(z: Floats, c: float, up: Floats, down: Floats) -> None:
    """Rates of the nearest-neighbour chain for the gap: drift ``c - z``, diffusion 1, out at ``z = 0``.

    Scharfetter-Gummel: positive, conservative, and the stationary Gaussian of Eq. (17) is its exact fixed point up
    to the second order of the cells. ``up[i]`` leads from node i to i+1, ``down[i]`` to i-1; node 0 absorbs.
    """
    m = z.size - 1
    for i in range(m):
        h = z[i + 1] - z[i]
        d = (c - 0.5 * (z[i] + z[i + 1])) * h
        b = _bernoulli(d)
        if i > 0:
            up[i] = (b + d) / (h * 0.5 * (z[i + 1] - z[i - 1]))
        width = 0.5 * (z[i + 2] - z[i]) if i + 2 <= m else 0.5 * h
        down[i + 1] = b / (h * width)
    up[m] = 0.0


# ---------------------------------------------------------------- steady sliding, N to infinity


@jit
def _steady_moments(u: float, delta: float, newborn: float, cells: int, steps: int) -> tuple[float, float]:
    """Moments of one life at one resolution, see `steady_moments`; in units of `mean` and 1/rate^2."""
    z = _gap_nodes(u, delta, newborn, cells)
    age = _age_nodes(u, delta, newborn, steps)
    m = z.size - 1
    c0, r = (1.0 - u) / delta, u / delta
    up, down, upper = np.zeros(m + 1), np.zeros(m + 1), np.zeros(m + 1)
    life, work = np.zeros(m + 1), np.zeros(m + 1)  # what is still to come, as a function of the gap
    b0, b1 = np.zeros(m + 1), np.zeros(m + 1)
    for j in range(steps - 1, -1, -1):
        da = age[j + 1] - age[j]
        middle = 0.5 * (age[j + 1] + age[j])
        _chain(z, c0 - r * middle, up, down)
        # Crank-Nicolson rings on the abrupt start; the oldest ages, which hardly anyone reaches, damp that.
        implicit = 0.5 if j < steps - 8 else 1.0
        explicit = (1.0 - implicit) * da
        implicit *= da
        for i in range(1, m + 1):
            k = min(i + 1, m)
            b0[i] = life[i] + explicit * (down[i] * (life[i - 1] - life[i]) + up[i] * (life[k] - life[i])) + da
            b1[i] = (
                work[i] + explicit * (down[i] * (work[i - 1] - work[i]) + up[i] * (work[k] - work[i])) + da * u * middle
            )
            below = implicit * down[i]
            pivot = 1.0 / (1.0 + below + implicit * up[i] - below * upper[i - 1])
            b0[i] = (b0[i] + below * b0[i - 1]) * pivot
            b1[i] = (b1[i] + below * b1[i - 1]) * pivot
            upper[i] = implicit * up[i] * pivot
        life[m], work[m] = b0[m], b1[m]
        for i in range(m - 1, 0, -1):
            life[i] = b0[i] + upper[i] * life[i + 1]
            work[i] = b1[i] + upper[i] * work[i + 1]
    if newborn > 0.0:
        place = newborn / delta
        i = int(np.searchsorted(z, place))
        w = (place - z[i - 1]) / (z[i] - z[i - 1])
        return (1.0 - w) * life[i - 1] + w * life[i], (1.0 - w) * work[i - 1] + w * work[i]
    # Slopes at the boundary, from W'' + c W' + g = 0 there: g = 1 for the life, 0 for the work.
    h = z[1]
    slope = 1.0 / (h * (1.0 - 0.5 * c0 * h))
    return (life[1] + 0.5 * h * h) * slope, work[1] * slope


@jit
def _resolution(u: float, delta: float, newborn: float, cells: int) -> tuple[int, int]:
    """Cells of the gap and steps of the age that keep the same accuracy everywhere.

    A narrow law makes thin layers, a newborn that must come down to its boundary makes a travelling pulse, and a
    slow slide takes many times 1/rate^2.
    """
    peclet = newborn * max(u - 1.0, 0.0) / delta**2
    more = min(max(1.0, 0.1 / delta, peclet / 60.0), 16.0)
    gaps = int(cells * more)
    return gaps, gaps * (4 if u < 0.02 else 2)


@jit
def steady_moments(u: float, delta: float, newborn: float, cells: int) -> tuple[float, float]:
    """Moments of one life of a contact in sliding at constant velocity, by the kinetic equation, Eqs. (13)-(17).

    With ``a`` the age in units of 1/rate^2 and ``S(a)`` the survivors, the moments are ``int S da`` and
    ``int u a S da``; their ratio is the mean stretching of attached contacts in units of `mean`.

    The backward (adjoint) equation is solved: what is still to come, as a function of age and gap, is smooth where
    the density is singular. Chang-Cooper / Scharfetter-Gummel rates in the gap, Crank-Nicolson in the age, and one
    Richardson extrapolation.

    Parameters
    ----------
    u : float
        ``velocity / (rate^2 mean)``, above 0.
    delta : float
        ``spread / mean``, above 0.
    newborn : float
        Threshold at birth in units of `mean`. For 0 a contact is born on the boundary of breaking; the moments are
        then those of an excursion, per unit of its entrance law (their slope in the gap, in units of the spread).
    cells : int
        Cells of the coarser grid; 100 gives 1e-5 (for 1e-5 <= u <= 50 and delta >= 0.1).

    Returns
    -------
    life, work : float
        ``int S da`` and ``int u a S da``.
    """
    gaps, steps = _resolution(u, delta, newborn, cells)
    life, work = _steady_moments(u, delta, newborn, gaps, steps)
    finer_life, finer_work = _steady_moments(u, delta, newborn, 2 * gaps, 2 * steps)
    # The error of a ratio is extrapolated, not those of its parts: they share most of it.
    ratio = (4.0 * finer_work / finer_life - work / life) / 3.0
    finer_life += (finer_life - life) / 3.0
    return finer_life, ratio * finer_life


@jit
def steady_friction(
    velocity: Floats,
    rate: float,
    spread: float,
    newborn: float = 0.0,
    mean: float = 1.0,
    delay: float = 0.0,
    cells: int = 100,
) -> Floats:
    """Force of the contacts in smooth sliding, N to infinity, from Eqs. (13)-(17).

    A function of ``u = velocity/(rate^2 mean)`` alone (without delay); it falls as ``spread^2/mean u/(u-1)^2`` at
    large u.

    Parameters
    ----------
    velocity : ndarray, shape (n,)
        Sliding velocities, not 0. The force has the sign of the velocity.
    rate, spread, mean, newborn : float
        Of Eqs. (15) and (16): beta, delta f_s, f_s, and the threshold of a newborn contact.
    delay : float
        Mean time a broken contact stays detached. With ``newborn = 0`` no contact ever holds for it.
    cells : int
        See `steady_moments`.

    Returns
    -------
    ndarray, shape (n,)
        Force per contact.
    """
    force = np.zeros(velocity.size)
    time = 1.0 / (rate * rate)
    for i in range(velocity.size):
        v = velocity[i]
        if delay > 0.0 and newborn <= 0.0:
            continue
        life, work = steady_moments(abs(v) * time / mean, spread / mean, newborn / mean, cells)
        force[i] = np.sign(v) * mean * work / (life + delay / time)
    return force


# ---------------------------------------------------------------- the slider


@jit
def drive_at(drive: Floats, time: float) -> tuple[float, float, float, float]:
    """Place, velocity and acceleration of the drive at a time, and the time of its next knot.

    Parameters
    ----------
    drive : ndarray, shape (segments, 4)
        Rows ``(start time, displacement at the start, velocity at the start, acceleration)``, in order of time. The
        last row lasts for ever, the first holds before its start as well.
    time : float
        A knot belongs to the segment that it opens.

    Returns
    -------
    displacement, velocity, acceleration, knot : float
    """
    row = 0
    while row + 1 < drive.shape[0] and drive[row + 1, 0] <= time:
        row += 1
    s = time - drive[row, 0]
    knot = drive[row + 1, 0] if row + 1 < drive.shape[0] else np.inf
    v, a = drive[row, 2], drive[row, 3]
    return drive[row, 1] + s * (v + 0.5 * a * s), v + a * s, a, knot


@jit
def _oscillator(
    X: float, V: float, k: float, mass: float, damping: float, g0: float, g1: float, g2: float, dt: float
) -> tuple[float, float, float]:
    """Exact step of ``M X'' + M eta X' + k X = g0 + g1 t + g2 t^2``, Eq. (11) between breaks.

    Returns the new X and V, and the amplitude of the free oscillation about the forced motion.
    """
    p2 = g2 / k
    p1 = (g1 - 2.0 * mass * damping * p2) / k
    p0 = (g0 - mass * damping * p1 - 2.0 * mass * p2) / k
    x, v = X - p0, V - p1
    half = 0.5 * damping
    square = k / mass - half * half
    w = np.sqrt(abs(square))
    decay = np.exp(-half * dt)
    if w * dt < 1e-6:  # critically damped
        c, s = decay, decay * dt
    elif square > 0.0:
        c, s = decay * np.cos(w * dt), decay * np.sin(w * dt) / w
    else:  # hyperbolic functions would grow beyond all bounds before they are damped
        fast, slow = half + w, k / mass / (half + w)
        soon, late = np.exp(-fast * dt), np.exp(-slow * dt)
        c, s = 0.5 * (late + soon), 0.5 * (late - soon) / w
    new_x = c * x + s * (v + half * x)
    new_v = c * v - s * (half * v + k / mass * x)
    amplitude = np.sqrt(x * x + (v + half * x) ** 2 / max(w * w, k / mass * 1e-6))
    return new_x + p0 + dt * (p1 + p2 * dt), new_v + p1 + 2.0 * p2 * dt, amplitude


@jit
def _slide(
    drive: Floats,
    slider: Floats,
    now: float,
    X: float,
    V: float,
    F: float,
    grip: float,
    loss: float,
    ramp: float,
    time: float,
) -> tuple[float, float, float]:
    """Slider a `time` later if the contacts' force is ``F + grip (X(t) - X) - loss t - ramp t^2/2``, Eq. (11).

    `loss` is what breaking takes from the force per time at the start, `ramp` how fast that grows.

    Returns X, V and the amplitude of the free oscillation. No knot of the drive may lie between.
    """
    K, mass, damping = slider[0], slider[1], slider[2]
    D, v, a, _ = drive_at(drive, now)
    if np.isinf(K):
        return D + time * (v + 0.5 * a * time), v + a * time, 0.0
    return _oscillator(X, V, K + grip, mass, damping, K * D - F + grip * X, K * v + loss, 0.5 * (K * a + ramp), time)


@jit
def _pace(
    now: float,
    until: float,
    drive: Floats,
    slider: Floats,
    V: float,
    grip: float,
    amplitude: float,
    longest: float,
    reach: float,
    angle: float,
) -> float:
    """Next step of time: none beyond `until`, none in which the slider goes farther than `reach`.

    A free oscillation that matters is followed in steps of `angle` (rad).
    """
    _, v, a, _ = drive_at(drive, now)
    fast = abs(v) + abs(a) * longest
    if not np.isinf(slider[0]):
        fast = max(fast, abs(V))
        if amplitude > 0.05 * reach:
            longest = min(longest, angle / np.sqrt((slider[0] + grip) / slider[1]))
    longest = min(longest, reach / max(fast, 1e-300))
    if now + 1.0000001 * longest >= until:
        return until - now
    # A sliver of a step before the end is shared with the step before it.
    return 0.5 * (until - now) if now + 2.0 * longest > until else longest


@jit
def _guess(
    drive: Floats,
    slider: Floats,
    now: float,
    X: float,
    V: float,
    F: float,
    grip: float,
    loss: float,
    ramp: float,
    dt: float,
) -> tuple[float, float, float, float]:
    """Slide for `dt`, or until the slider turns back; returns X, V, amplitude and how long it was."""
    new_X, new_V, amplitude = _slide(drive, slider, now, X, V, F, grip, loss, ramp, dt)
    if new_V * V < 0.0:
        turn = dt * V / (V - new_V)
        if 0.05 * dt < turn < 0.95 * dt:
            dt = turn
            new_X, new_V, amplitude = _slide(drive, slider, now, X, V, F, grip, loss, ramp, dt)
    return new_X, new_V, amplitude, dt


@jit
def _fill(
    samples: Floats,
    filled: int,
    times: Floats,
    end: float,
    drive: Floats,
    slider: Floats,
    now: float,
    X: float,
    V: float,
    F: float,
    grip: float,
    loss: float,
    ramp: float,
    attached: float,
) -> int:
    """Fill the samples up to the `end` of a step that began `now`; returns how many are filled."""
    while filled < times.size and times[filled] <= end:
        t = times[filled] - now
        x, v, _ = _slide(drive, slider, now, X, V, F, grip, loss, ramp, t)
        force = F + grip * (x - X) - t * (loss + 0.5 * ramp * t)
        pull = force if np.isinf(slider[0]) else slider[0] * (drive_at(drive, times[filled])[0] - x)
        samples[filled, 0], samples[filled, 1], samples[filled, 2] = x, v, pull
        samples[filled, 3], samples[filled, 4] = force, attached
        filled += 1
    return filled


# ---------------------------------------------------------------- N contacts


@jit
def _inverse_gaussian(mu: float, shape: float, rng: np.random.Generator) -> float:
    """Inverse Gaussian number of mean `mu` (may be huge) and given shape, after Michael, Schucany and Haas."""
    z = rng.standard_normal()
    q = 0.5 * mu * z * z / shape
    x = mu / (1.0 + q + float(np.sqrt(q * (2.0 + q))))
    if rng.random() * (mu + x) > mu:
        return mu * mu / x
    return x


@jit
def _crossing(start: float, end: float, variance: float, rng: np.random.Generator) -> float:
    """Share of a step after which a Brownian bridge of the gap first meets zero, given that it does.

    The bridge is a Brownian motion with drift in the clock ``t/(1-t)``, whose first passage is inverse Gaussian.
    """
    if start <= 0.0:
        return 0.0
    clock = _inverse_gaussian(start / max(abs(end), 1e-12 * start), start * start / variance, rng)
    return clock / (1.0 + clock)


@jit
def _regenerate(start: float, drift: float, noise: float, time: float, rng: np.random.Generator) -> tuple[float, float]:
    """Gap of a contact that is reborn on its boundary whenever it meets it; and its age.

    The gap is a Brownian motion with drift, reflected at 0: free motion less its running minimum where that is
    below 0, sampled exactly by the bridge law of the minimum, so that a step may hold any number of breaks. The time
    since the last visit to 0 is the time since the minimum; of it the mean is taken, given all else: the forces need
    no more, and two passage times (before the minimum and after it) share the step in proportion to their depths.

    Parameters
    ----------
    start : float
        Gap at the start, 0 for a newborn.
    drift, noise : float
        Drift of the gap, and the square of its noise, ``<dy^2>/dt``.
    time : float
        How long it goes on.

    Returns
    -------
    gap, age : float
        The age is -1 where the contact has not broken.
    """
    variance = noise * time
    if variance <= 0.0:
        free = start + drift * time
        if free > 0.0:
            return free, time if start == 0.0 else -1.0
        return 0.0, 0.0
    if start == 0.0 and drift < 0.0 and drift * drift * time > FORGOTTEN * noise:
        # Stationary: the minimum over an endless past, and the first passage backwards from the gap to it.
        gap = -0.5 * noise / drift * rng.standard_exponential()
        return gap, -gap / drift
    way = drift * time + np.sqrt(variance) * rng.standard_normal()
    down = 0.5 * (np.sqrt(way * way + 2.0 * variance * rng.standard_exponential()) - way)
    if down < start:
        return start + way, -1.0
    gap = max(way + down, 0.0)
    return gap, time * gap / (down + gap) if gap > 0.0 else 0.0


@jit
def _gap_drift(rate: float, mean: float, noise: float, speed: float, time: float) -> float:
    """Constant drift of the gap that stands for ``rate^2 (mean - f) - speed`` near the boundary.

    The threshold ``f`` of a contact near its boundary is small, not 0. Long after the last memory (relaxation time
    noise/drift^2) its effect on the force is that of 2.25 mean gaps and 2.8 mean ways, the first order of the
    stationary kinetic equation at large speed; after a short time it is that of the growth so far.
    """
    drift = rate * rate * mean - speed
    if drift >= 0.0:
        gap, way = 0.7 * np.sqrt(noise * time), 0.5 * speed * time
    else:
        gap = 1.0 / (1.0 / (0.7 * np.sqrt(noise * time)) - 2.0 * drift / (2.25 * noise))
        way = speed / (2.0 / time + 2.0 * drift * drift / (2.8 * noise))
    return drift - rate * rate * float(gap + way)


@jit
def _age_contacts(
    base: Floats,
    threshold: Floats,
    attach: Floats,
    seen: Floats,
    until: Floats,
    room: Floats,
    now: float,
    dt: float,
    X: float,
    dX: float,
    law: Floats,
    delays: Floats,
    rng: np.random.Generator,
) -> tuple[float, int]:
    """One step of all contacts while the slider moves from `X` to ``X + dX`` at constant velocity.

    A contact far from breaking sleeps (`SLEEP`): nothing is done until the time ``until`` or until the slider leaves
    the range ``room`` (low and high end for each contact); its threshold is that of the time ``seen``, its stretching
    is ``base + X`` all the time.

    Returns what breaking has taken from the sum of all stretchings, and how many contacts the step has attached
    (less those that it has detached).
    """
    rate, mean, spread, newborn = law[0], law[1], law[2], law[3]
    square = rate * rate
    decay = np.exp(-square * dt)
    kick = spread * np.sqrt(1.0 - decay * decay)
    # Of the bridge, in the clock that makes an Ornstein-Uhlenbeck process a Brownian motion.
    variance = 2.0 * spread * spread * np.sinh(square * dt)
    noise = 2.0 * square * spread * spread
    v = dX / dt
    end, new_X = now + dt, X + dX
    # Where a step holds many lives, the moment of the first break in it does not matter.
    fall = abs(v) - square * mean
    forgotten = newborn <= 0.0 and fall > 0.0 and fall * fall * dt > FORGOTTEN * noise
    young = newborn <= 0.0 and fall > 2.0 * square * mean
    certain = fall * dt - 6.0 * np.sqrt(noise * dt) if forgotten else -1.0
    whole = _gap_drift(rate, mean, noise, abs(v), dt)
    lost, more = 0.0, 0
    for i in range(base.size):
        if end <= until[i] and room[i, 0] <= new_X <= room[i, 1]:
            continue
        if attach[i] <= now:
            left, x, f = dt, base[i] + X, threshold[i]
            if seen[i] < now:
                e = np.exp(-square * (now - seen[i]))
                f = mean + (f - mean) * e + spread * np.sqrt(1.0 - e * e) * rng.standard_normal()
                gap = f - abs(x) - max(f - mean, 0.0)
                if gap > 3.0 * abs(dX) and SLEEP * gap * gap > noise * dt:  # on it sleeps
                    threshold[i], seen[i], until[i] = f, now, now + SLEEP * gap * gap / noise
                    room[i, 0], room[i, 1] = X - gap / 3.0, X + gap / 3.0
                    continue
            lost += x + dX
            more -= 1
        else:
            left, x, f = end - attach[i], 0.0, newborn
            if left <= 0.0:
                continue
        gap = f - abs(x)
        if gap < certain:
            gap, age = _regenerate(0.0, whole, noise, dt, rng)
            x, left = v * age, 0.0
            f = abs(x) + gap
        elif young and f < 0.1 * mean and x * v >= 0.0 and left == dt:
            # Near the boundary and driven towards it: the drift is as good as constant, one sample does it all.
            gap, age = _regenerate(max(gap, 0.0), min(whole, square * (mean - f) - abs(v)), noise, dt, rng)
            x, left = (v * age if age >= 0.0 else x + dX), 0.0
            f = abs(x) + gap
        while left > 0.0:
            if left == dt:
                e, sigma, var = decay, kick, variance
            else:
                e = np.exp(-square * left)
                sigma = spread * np.sqrt(1.0 - e * e)
                var = 2.0 * spread * spread * np.sinh(square * left)
            new_x = x + v * left
            new_f = mean + (f - mean) * e + sigma * rng.standard_normal()
            gap = max(f - abs(x), 0.0)
            new_gap = new_f - abs(new_x)
            if new_gap > 0.0:
                hidden = 2.0 * gap * new_gap / var
                if hidden > 40.0 or rng.standard_exponential() < hidden:
                    x, f, left = new_x, new_f, 0.0
                    break
            if newborn > 0.0:
                left *= 1.0 - _crossing(gap, new_gap, var, rng)
                left -= delays[int(rng.random() * delays.size)]
                x, f = 0.0, newborn
            else:
                if not forgotten:
                    left *= 1.0 - _crossing(gap, new_gap, var, rng)
                gap, age = _regenerate(0.0, _gap_drift(rate, mean, noise, abs(v), left), noise, left, rng)
                x = v * age
                f = abs(x) + gap
                left = 0.0
        if left < 0.0:
            attach[i] = until[i] = end - left
            room[i, 0], room[i, 1] = -np.inf, np.inf
            continue
        lost -= x
        more += 1
        attach[i] = -np.inf
        base[i], threshold[i], seen[i] = x - new_X, f, end
        gap = f - abs(x) - max(f - mean, 0.0)
        if gap > 0.0:
            until[i] = end + SLEEP * gap * gap / noise if noise > 0.0 else np.inf
            room[i, 0], room[i, 1] = new_X - gap / 3.0, new_X + gap / 3.0
        else:
            until[i] = -np.inf
    return lost, more


@jit
def advance_contacts(
    state: Floats,
    stretching: Floats,
    threshold: Floats,
    attach: Floats,
    drive: Floats,
    slider: Floats,
    law: Floats,
    delays: Floats,
    times: Floats,
    step: float,
    reach: float,
    rng: np.random.Generator,
    pausing: bool = False,
) -> Floats:
    """Advance N ageing contacts and the slider to the last of `times`, Eqs. (11) and (13)-(16).

    Per contact and step: an exact Ornstein-Uhlenbeck step of the threshold, a Brownian-bridge test for breaking
    inside the step, the exact law of the moment of breaking, and for contacts born on their boundary the exact law
    of the gap after any number of breaks (`_regenerate`). Contacts far from breaking are left alone. The slider is
    the exact oscillator of the driving spring and the contacts, less what breaking takes from their force: guessed
    from the step before, the contacts move; then known, the slider moves again (second order in the step). Samples
    inside a step are taken from that oscillation.

    Parameters
    ----------
    state : ndarray, shape (4,)
        Time, X, V and what breaking takes from the force per time (0 at the start; a memory of the step before);
        changed in place.
    stretching, threshold, attach : ndarray, shape (N,)
        Stretchings, thresholds, and the times from which contacts hold (``-inf`` for attached ones); changed in
        place.
    drive : ndarray, shape (segments, 4)
        See `drive_at`.
    slider : ndarray, shape (3,)
        K, M, eta of Eq. (11), per contact. ``K = inf`` is rigid motion: the slider is the drive.
    law : ndarray, shape (4,)
        rate, mean, spread, newborn.
    delays : ndarray, shape (n,)
        Delays after breaking, one drawn at random for each break; ``[0.]`` for none. A delay needs a newborn
        threshold above 0.
    times : ndarray, shape (m,)
        When to sample, ascending, none before now.
    step : float
        Largest step in units of 1/rate^2; 0.04 is converged to 2e-3 in steady motion.
    reach : float
        Largest way of the slider in a step, in units of `mean`; 0.02 with a slider, inf for steady rigid motion.
    rng : numpy.random.Generator
    pausing : bool
        End a step at each sample: a run that is cut there has gone the same way.

    Returns
    -------
    ndarray, shape (m, 5)
        X, V, driving force F_d, contact force F_c (both per contact), share of attached contacts.
    """
    rate, mean, spread = law[0], law[1], law[2]
    rigid = np.isinf(slider[0])
    n = stretching.size
    now, X, V, loss = state[0], state[1], state[2], state[3]
    if law[3] <= 0.0 and np.max(delays) > 0.0:
        raise ValueError("a delay after breaking needs a newborn threshold above 0")
    if rigid and times.size > 0:
        X = drive_at(drive, now)[0]
    total, count = 0.0, 0
    seen, until, room = np.full(n, now), np.full(n, -np.inf), np.zeros((n, 2))
    for i in range(n):
        if attach[i] <= now:
            total += stretching[i]
            count += 1
        else:
            until[i], room[i, 0], room[i, 1] = attach[i], -np.inf, np.inf
        stretching[i] -= X
    amplitude, samples = 0.0, np.empty((times.size, 5))
    filled = _fill(samples, 0, times, now, drive, slider, now, X, V, total / n, 1.0, 0.0, 0.0, count / n)
    while filled < times.size:
        X_0, V_0, F, grip = X, V, total / n, count / n
        end = min(times[filled if pausing else -1], drive_at(drive, now)[3])
        dt = _pace(now, end, drive, slider, V, grip, amplitude, step / rate**2, reach * mean, 0.7)
        X, V, amplitude, shorter = _guess(drive, slider, now, X_0, V_0, F, grip, loss, 0.0, dt)
        if shorter < dt or dt < end - now:
            dt, end = shorter, now + shorter
        lost, more = _age_contacts(
            stretching, threshold, attach, seen, until, room, now, dt, X_0, X - X_0, law, delays, rng
        )
        loss = lost / (n * dt)
        total += count * (X - X_0) - lost
        count += more
        if not rigid:
            X_1 = X
            X, V, amplitude = _slide(drive, slider, now, X_0, V_0, F, grip, loss, 0.0, dt)
            total += count * (X - X_1)
        filled = _fill(samples, filled, times, end, drive, slider, now, X_0, V_0, F, grip, loss, 0.0, count / n)
        now = end
    for i in range(n):
        stretching[i] += X
        if attach[i] > now:
            stretching[i] = 0.0
        elif seen[i] < now:
            e = np.exp(-rate * rate * (now - seen[i]))
            f = mean + (threshold[i] - mean) * e + spread * np.sqrt(1.0 - e * e) * rng.standard_normal()
            threshold[i] = max(f, abs(stretching[i]))
    state[0], state[1], state[2], state[3] = now, X, V, loss
    return samples


# ---------------------------------------------------------------- linear stability of smooth sliding


@jit
def _stability_nodes(u: float, delta: float, newborn: float, cells: int) -> tuple[Floats, Floats]:
    """Nodes of gap and age that also resolve the entrance of excursions: geometric from the first cell upwards."""
    c = (1.0 - u) / delta
    coarse = _gap_nodes(u, delta, newborn, cells)
    first = coarse[1] if newborn > 0.0 else 1.5 / (cells * max(1.0, abs(c)))
    z = _graded(coarse[-1], cells, first)
    smooth = _age_nodes(u, delta, newborn, 2 * cells)
    age = np.empty(40 * cells)
    age[0] = 0.0
    start, j, k = 0.3 * z[1] * z[1], 0, 0
    while age[k] < smooth[-1] and k + 1 < age.size:
        while smooth[j + 1] <= age[k] and j + 2 < smooth.size:
            j += 1
        age[k + 1] = min(age[k] + min(8.0 / cells * (age[k] + start), smooth[j + 1] - smooth[j]), smooth[-1])
        k += 1
    return z, age[: k + 1].copy()


@jit
def _density_by_age(u: float, delta: float, newborn: float, z: Floats, age: Floats) -> Floats:
    """Density (mass per node) of one life in steady sliding, for all ages; shape (ages, nodes).

    An L-stable Runge-Kutta step of second order (SDIRK2) from a unit of mass at the newborn's gap, or at the first
    node where the newborn is on its boundary.
    """
    m = z.size - 1
    c0, r = (1.0 - u) / delta, u / delta
    gamma = 1.0 - np.sqrt(0.5)
    up, down = np.zeros(m + 1), np.zeros(m + 1)
    mass = np.zeros((age.size, m + 1))
    if newborn > 0.0:
        place = newborn / delta
        i = int(np.searchsorted(z, place))
        w = (place - z[i - 1]) / (z[i] - z[i - 1])
        mass[0, i - 1], mass[0, i] = 1.0 - w, w
        mass[0, 0] = 0.0
    else:
        mass[0, 1] = 1.0
    upper, slope, stage = np.zeros(m + 2), np.zeros((2, m + 1)), np.zeros(m + 2)
    for j in range(age.size - 1):
        h = age[j + 1] - age[j]
        for k in range(2):
            _chain(z, c0 - r * (age[j] + h * (gamma if k == 0 else 1.0)), up, down)
            # (1 - gamma h L) stage = known; slope = L stage
            for i in range(1, m + 1):
                known = mass[j, i] + (h * (1.0 - gamma) * slope[0, i] if k == 1 else 0.0)
                below = gamma * h * up[i - 1]
                pivot = 1.0 / (1.0 + gamma * h * (up[i] + down[i]) - below * upper[i - 1])
                stage[i] = (known + below * stage[i - 1]) * pivot
                upper[i] = gamma * h * (down[i + 1] if i < m else 0.0) * pivot
                slope[k, i] = -known
            for i in range(m - 1, 0, -1):
                stage[i] += upper[i] * stage[i + 1]
            for i in range(1, m + 1):
                slope[k, i] = (slope[k, i] + stage[i]) / (gamma * h)
        for i in range(1, m + 1):
            mass[j + 1, i] = stage[i]
    return mass


@jit
def _responses(
    u: float, delta: float, newborn: float, s: NDArray[np.complex128], z: Floats, age: Floats, mass: Floats
) -> NDArray[np.complex128]:
    """Transforms of one life at Laplace variables `s`, and of its linear response to a shaken slider; shape (4, n).

    ``int S e^{-sa}``, ``int u a S e^{-sa}``, and the same two of the perturbation of S. Real and imaginary parts lie
    apart and all variables side by side, so that the inner loops run on vectors.
    """
    m, n, count = z.size - 1, age.size - 1, s.size
    c0, r = (1.0 - u) / delta, u / delta
    re, im = s.real.copy(), s.imag.copy()
    up, down, ahead, back = np.zeros(m + 1), np.zeros(m + 1), np.zeros(m + 1), np.zeros(m + 1)
    # What is still to come: real and imaginary parts of the life, then of the work.
    future = np.zeros((4, m + 1, count))
    known, upper = np.zeros((4, m + 1, count)), np.zeros((2, m + 1, count))
    slope = np.zeros((4, count))
    response, right = np.zeros((count, 2), dtype=np.complex128), np.zeros((count, 2), dtype=np.complex128)
    for j in range(n - 1, -1, -1):
        da = age[j + 1] - age[j]
        middle = 0.5 * (age[j + 1] + age[j])
        _chain(z, c0 - r * middle, up, down)
        share = 0.5 if j < n - 8 else 1.0
        explicit, implicit = (1.0 - share) * da, share * da
        # What a unit of extra drift at this age would add, in all: density times slope of what is to come.
        c = c0 - r * age[j]
        for i in range(1, m + 1):
            h = z[i] - z[i - 1]
            pull = _bernoulli_slope((c - 0.5 * (z[i - 1] + z[i])) * h)
            back[i] = -pull * mass[j, i] / (0.5 * (z[i + 1] - z[i - 1]) if i < m else 0.5 * h)
            if i > 1:
                ahead[i - 1] = (1.0 + pull) * mass[j, i - 1] / (0.5 * (z[i] - z[i - 2]))
        for i in range(1, m + 1):
            off, on, below, above = explicit * down[i], explicit * up[i], implicit * down[i], implicit * up[i]
            stay, gain = 1.0 - off - on, (da, 0.0, da * u * middle, 0.0)
            k = min(i + 1, m)
            for part in range(2):
                x, y = future[2 * part], future[2 * part + 1]
                bx, by = known[2 * part], known[2 * part + 1]
                more = gain[2 * part]
                for q in range(count):
                    still, turn = stay - explicit * re[q], -explicit * im[q]
                    bx[i, q] = still * x[i, q] - turn * y[i, q] + off * x[i - 1, q] + on * x[k, q] + more
                    by[i, q] = still * y[i, q] + turn * x[i, q] + off * y[i - 1, q] + on * y[k, q]
            for q in range(count):
                dx = 1.0 + implicit * re[q] + above + below - below * upper[0, i - 1, q]
                dy = implicit * im[q] - below * upper[1, i - 1, q]
                size = 1.0 / (dx * dx + dy * dy)
                px, py = dx * size, -dy * size
                fx, fy = known[0, i, q] + below * known[0, i - 1, q], known[1, i, q] + below * known[1, i - 1, q]
                gx, gy = known[2, i, q] + below * known[2, i - 1, q], known[3, i, q] + below * known[3, i - 1, q]
                known[0, i, q], known[1, i, q] = fx * px - fy * py, fx * py + fy * px
                known[2, i, q], known[3, i, q] = gx * px - gy * py, gx * py + gy * px
                upper[0, i, q], upper[1, i, q] = above * px, above * py
        future[:, m] = known[:, m]
        for i in range(m - 1, 0, -1):
            for part in range(2):
                x, y = future[2 * part], future[2 * part + 1]
                for q in range(count):
                    cx, cy = upper[0, i, q], upper[1, i, q]
                    x[i, q] = known[2 * part, i, q] + cx * x[i + 1, q] - cy * y[i + 1, q]
                    y[i, q] = known[2 * part + 1, i, q] + cx * y[i + 1, q] + cy * x[i + 1, q]
        slope[:] = 0.0
        for part in range(4):
            x, total = future[part], slope[part]
            for i in range(1, m + 1):
                k = min(i + 1, m)
                for q in range(count):
                    total[q] += ahead[i] * (x[k, q] - x[i, q]) + back[i] * (x[i, q] - x[i - 1, q])
        # times the extra drift e^{-sa} - 1 - s: linear between the nodes, the exponential exactly.
        for q in range(count):
            turn_q = s[q] * da
            if abs(turn_q) < 1e-2:
                whole = 1.0 - turn_q / 2.0 + turn_q * turn_q / 6.0 - turn_q**3 / 24.0
                ramp = 0.5 - turn_q / 3.0 + turn_q * turn_q / 8.0 - turn_q**3 / 30.0
            else:
                e = np.exp(-turn_q)
                whole = (1.0 - e) / turn_q
                ramp = (1.0 - e * (1.0 + turn_q)) / (turn_q * turn_q)
            wave, half = np.exp(-s[q] * age[j]), 0.5 * (1.0 + s[q])
            here, there = wave * (whole - ramp) - half, wave * ramp - half
            first, second = complex(slope[0, q], slope[1, q]), complex(slope[2, q], slope[3, q])
            response[q, 0] += da * (first * here + right[q, 0] * there)
            response[q, 1] += da * (second * here + right[q, 1] * there)
            right[q, 0], right[q, 1] = first, second
    answer = np.empty((4, count), dtype=np.complex128)
    i = int(np.searchsorted(z, newborn / delta)) if newborn > 0.0 else 1
    w = mass[0, i] if newborn > 0.0 else 1.0
    # The half cell at the boundary belongs to the life of a contact that is born on it, too.
    edge = 0.5 * z[1] * z[1] if newborn <= 0.0 else 0.0
    for q in range(count):
        lower, higher = future[:, i - 1, q], future[:, i, q]
        answer[0, q] = (1.0 - w) * complex(lower[0], lower[1]) + w * complex(higher[0], higher[1]) + edge
        answer[1, q] = (1.0 - w) * complex(lower[2], lower[3]) + w * complex(higher[2], higher[3])
        answer[2, q], answer[3, q] = response[q, 0] / delta, response[q, 1] / delta
    return answer


@jit
def _bernoulli_slope(z: float) -> float:
    """Derivative of the Bernoulli function."""
    if abs(z) < 1e-2:
        return -0.5 + z / 6.0 - z**3 / 180.0
    if z > 300.0:
        return 0.0
    if z < -300.0:
        return -1.0
    e = float(np.expm1(z))
    return (e - z * (e + 1.0)) / (e * e)


@jit
def life_transforms(
    u: float, delta: float, newborn: float, p: NDArray[np.complex128], cells: int
) -> NDArray[np.complex128]:
    """What one life contributes to the dynamic stiffness, at one resolution; see `dynamic_stiffness_ageing`.

    Parameters
    ----------
    u, delta, newborn : float
        ``velocity/(rate^2 mean)``, ``spread/mean`` and ``newborn/mean``.
    p : ndarray of complex, shape (n,)
        Laplace variable in units of rate^2.
    cells : int
        Cells of the gap.

    Returns
    -------
    ndarray of complex, shape (4, n + 1)
        For each `p`, and last for 0: ``int S e^{-pa}``, ``int u a S e^{-pa}``, and the same two of the perturbation of
        the survivors S by a slider that is shaken by ``e^{pa}``.
    """
    z, age = _stability_nodes(u, delta, newborn, cells)
    mass = _density_by_age(u, delta, newborn, z, age)
    return _responses(u, delta, newborn, np.append(p, np.zeros(1, dtype=np.complex128)), z, age, mass)


@jit
def _dynamic_stiffness(
    velocity: float,
    rate: float,
    spread: float,
    s: NDArray[np.complex128],
    newborn: float,
    mean: float,
    delays: Floats,
    cells: int,
) -> NDArray[np.complex128]:
    """`dynamic_stiffness_ageing` at one resolution."""
    square = rate * rate
    parts = life_transforms(velocity / (square * mean), spread / mean, newborn / mean, s / square, cells)
    rest = parts[0, s.size].real
    held = rest + np.mean(delays) * square
    kappa = np.empty(s.size, dtype=np.complex128)
    for k in range(s.size):
        p = s[k] / square
        away = 0j  # detached contacts, per birth
        if np.max(delays) > 0.0 and p != 0.0:
            e = np.mean(np.exp(-s[k] * delays))
            away = (1.0 - e) / (p * e)
        life, work, less, lost = parts[0, k], parts[1, k], parts[2, k], parts[3, k]
        kappa[k] = (rest - life + lost - less * work / (life + away)) / held
    return kappa


@jit
def dynamic_stiffness_ageing(
    velocity: float,
    rate: float,
    spread: float,
    s: NDArray[np.complex128],
    newborn: float = 0.0,
    mean: float = 1.0,
    delays: Floats = NO_DELAY,
    cells: int = 80,
) -> NDArray[np.complex128]:
    """Dynamic stiffness of ageing contacts about steady sliding, from Eqs. (11) and (13)-(17).

    A slider at ``X = velocity t + xi e^{st}`` feels the force ``F + kappa(s) xi e^{st}``; with a mass on a spring,
    the roots of ``M s^2 + M eta s + K + kappa(s) = 0`` are the modes of smooth sliding. kappa depends on
    ``velocity/(rate^2 mean)`` and ``s/rate^2`` only, tends to ``s dF/dv`` for small s and to 1 for large s.

    The density of the gap over the age is perturbed by the extra drift ``-d xi/dt - (xi(t) - xi(birth)) rate^2``; the
    births, counted by the local time of the gap at its boundary, follow from the conservation of contacts. The
    response of survivors is the density times the slope of the adjoint solution, which is smooth at any s: large
    imaginary s costs no finer grid.

    Parameters
    ----------
    velocity, rate, spread, newborn, mean : float
        See `steady_friction`; velocity above 0.
    s : ndarray of complex, shape (n,)
        Laplace variable, per time.
    delays : ndarray, shape (d,)
        Delays after breaking, equally likely; they need a newborn threshold above 0.
    cells : int
        Cells of the gap on the coarser of two grids, which one Richardson extrapolation joins; 80 gives some 2e-4
        for ``|s|`` below ten times rate^2, 2e-3 at a hundred times.

    Returns
    -------
    ndarray of complex, shape (n,)
        kappa, per contact, in units of the contact stiffness.
    """
    coarse = _dynamic_stiffness(velocity, rate, spread, s, newborn, mean, delays, cells)
    return (4.0 * _dynamic_stiffness(velocity, rate, spread, s, newborn, mean, delays, 2 * cells) - coarse) / 3.0


# ---------------------------------------------------------------- the kinetic equation, N to infinity


@jit
def gap_nodes(mean: float, spread: float, newborn: float, cells: float) -> Floats:
    """Nodes of the gap for `advance_density`: `cells` per spread, closer and closer towards the boundary.

    Contacts born on their boundary leave it as the square root of time, and a fast slider presses them against it:
    the first cells must be small. The last node lies beyond all thresholds.
    """
    end, widest = max(mean, newborn) + 8.0 * spread, spread / cells
    growth, h, k = 1.0 + 1.0 / cells, 0.06 * widest, 0
    nodes = np.zeros(int(end / widest) + int(3.0 / np.log(growth)) + 3)
    while nodes[k] < end:
        nodes[k + 1] = nodes[k] + h
        h = min(growth * h, widest)
        k += 1
    return nodes[: k + 1].copy()


@jit
def gap_widths(nodes: Floats) -> Floats:
    """Widths of the cells about the nodes; the first and the last are cut at their node."""
    width = np.empty(nodes.size)
    width[0], width[-1] = 0.5 * nodes[1], 0.5 * (nodes[-1] - nodes[-2])
    width[1:-1] = 0.5 * (nodes[2:] - nodes[:-2])
    return width


@jit
def _gap_rates(
    nodes: Floats,
    width: Floats,
    mass: Floats,
    moment: Floats,
    x: float,
    dx: float,
    ageing: tuple[float, float, float, float],
    first: int,
    top: int,
    up: Floats,
    down: Floats,
) -> None:
    """Rates between the gaps of one cohort while the slider moves by `dx`.

    ``up[i]`` leads from node i to i+1, ``down[i]`` to i-1; `ageing` holds the time, rate^2, the mean threshold and the
    diffusion. At each gap the contacts are stretched as they are there on average, by ``x - moment/mass``.
    """
    dt, square, mean, D = ageing
    widest = nodes[-1] - nodes[-2]
    for i in range(top):
        here, off = mass[i + 1], moment[i + 1]
        if i >= first:
            here += mass[i]
            off += moment[i]
        start = x - off / here if here > 1e-200 else x
        a, b = abs(start), abs(start + dx)
        h = nodes[i + 1] - nodes[i]
        ou, motion = square * (mean - 0.5 * (nodes[i] + nodes[i + 1] + a + b)), (b - a) / dt
        d = (ou - motion) * h / D
        flow = _bernoulli(d)
        if i > first and h > 0.999 * widest:
            # Far from the boundary a fast slider carries the density along: there central differences, as far as
            # they are positive, do not smear it.
            flow += motion * motion / (motion * motion + ou * ou + 1e-300) * (max(1.0 - 0.5 * d, 0.0, -d) - flow)
        up[i] = D * (flow + d) / (h * width[i])
        down[i + 1] = D * flow / (h * width[i + 1])
    down[0] = up[top] = 0.0


@jit
def _eliminate(up: Floats, down: Floats, first: int, top: int, dt: float, pivot: Floats, carry: Floats) -> None:
    """Elimination from above for the implicit steps of `_substitute`."""
    above = 0.0
    for i in range(top, first - 1, -1):
        pivot[i] = 1.0 / (1.0 + dt * (up[i] + down[i]) - above)
        carry[i] = dt * up[i - 1] * pivot[i] if i > 0 else 0.0
        above = dt * down[i] * carry[i]


@jit
def _substitute(
    known: Floats,
    below: float,
    down: Floats,
    first: int,
    top: int,
    dt: float,
    pivot: Floats,
    carry: Floats,
    solved: Floats,
) -> None:
    """Implicit step ``(1 - dt L) solved = known`` from node `first` to `top`, with `below` on the node below them."""
    above = 0.0
    for i in range(top, first - 1, -1):
        solved[i] = (known[i] + above) * pivot[i]
        above = dt * down[i] * solved[i]
    for i in range(first, top + 1):
        solved[i] += carry[i] * below
        below = solved[i]


@jit
def _advance_cohort(
    mass: Floats,
    moment: Floats,
    nodes: Floats,
    width: Floats,
    x: float,
    dx: float,
    ageing: tuple[float, float, float, float],
    gamma: float,
    top: int,
    births: tuple[int, float, float, float],
    work: Floats,
) -> tuple[float, float]:
    """One step of a cohort, by two implicit stages; returns the rates at which its contacts break in the two.

    ``gamma = 1 - 1/sqrt(2)`` gives SDIRK2, of second order and L-stable; ``gamma = 1/2`` two implicit Euler steps, of
    first order and positive. `births` are, for the open cohort, the node where contacts are born (-1 in others), the
    share born on the one above it, and the rates of births in the two stages.
    """
    up, down, pivot, carry, known, echo = work[0], work[1], work[2], work[3], work[4], work[5]
    birth, share, rates = births[0], births[1], (births[2], births[3])
    first = 0 if birth == 0 else 1  # newborns on the boundary: it reflects
    dt = gamma * ageing[0]
    _gap_rates(nodes, width, mass, moment, x, dx, ageing, first, top, up, down)
    _eliminate(up, down, first, top, dt, pivot, carry)
    again = 0.0
    if birth > 0:  # what one birth a time makes break within the same stage, to be born again
        known[: top + 1] = 0.0
        known[birth], known[birth + 1] = dt * (1.0 - share), dt * share
        _substitute(known, 0.0, down, first, top, dt, pivot, carry, echo)
        again = down[1] * echo[1]
    ahead = (1.0 - gamma) / gamma
    breaking = (0.0, 0.0)
    for stage in range(2):
        m, q = work[6 + 2 * stage], work[7 + 2 * stage]
        way = x + dx * (gamma if stage == 0 else 1.0)  # of the slider since the reference place
        born = rates[stage]
        for i in range(first, top + 1):
            known[i] = mass[i] if stage == 0 else mass[i] + ahead * (work[6, i] - mass[i])
        if birth >= 0:
            known[birth] += dt * born * (1.0 - share)
            known[birth + 1] += dt * born * share
        _substitute(known, 0.0, down, first, top, dt, pivot, carry, m)
        lost = down[1] * m[1]
        if birth > 0:
            lost /= 1.0 - again
            born += lost
            for i in range(1, top + 1):
                m[i] += lost * echo[i]
        for i in range(1, top + 1):
            known[i] = moment[i] if stage == 0 else moment[i] + ahead * (work[7, i] - moment[i])
        if birth > 0:
            known[birth] += dt * born * (1.0 - share) * way
            known[birth + 1] += dt * born * share * way
        _substitute(known, m[0] * way if birth == 0 else 0.0, down, 1, top, dt, pivot, carry, q)
        breaking = (lost, lost) if stage == 0 else (breaking[0], lost)
    for i in range(first, top + 1):
        mass[i], moment[i] = work[8, i], work[9, i]
        if mass[i] < 0.0:
            mass[i], moment[i] = 0.0, 0.0
    if birth == 0:
        moment[0] = mass[0] * (x + dx)
    return breaking


@jit
def _top(mass: Floats, moment: Floats, nodes: Floats, before: int, way: float) -> int:
    """Last node that a cohort can reach in a step; it held nothing above `before`. Dust at the top is swept down."""
    top = before
    while top > 2 and mass[top] < 1e-17:
        mass[top - 1] += mass[top]
        moment[top - 1] += moment[top]
        mass[top] = moment[top] = 0.0
        top -= 1
    end = nodes[top] + way
    while top < nodes.size - 1 and nodes[top] < end:
        top += 1
    return top


@jit
def _close(
    place: Floats, mass: Floats, moment: Floats, nodes: Floats, count: int, X: float, near: float, soft: float
) -> int:
    """Close the open cohort (row `count`) and open another; returns the number of closed cohorts.

    Contacts within some `soft` of their boundary stay open, so that no density is cut where it is steep. The closed
    cohort is joined to one whose place is `near`, if there is one.
    """
    m, q, fresh = mass[count], moment[count], count + 1
    total, off, way = 0.0, 0.0, X - place[count]
    for i in range(nodes.size):
        kept = np.exp(-((nodes[i] / soft) ** 2)) if soft > 0.0 else 0.0
        mass[fresh, i] = kept * m[i]
        moment[fresh, i] = kept * (q[i] - m[i] * way)
        m[i] -= mass[fresh, i]
        q[i] *= 1.0 - kept
        total += m[i]
        off += q[i]
    shift = off / total if total > 0.0 else 0.0
    q -= m * shift
    place[count] += shift
    place[fresh] = X
    nearest = -1
    for c in range(count):
        if nearest < 0 or abs(place[c] - place[count]) < abs(place[nearest] - place[count]):
            nearest = c
    if nearest >= 0 and (abs(place[nearest] - place[count]) < near or count + 2 >= place.size):
        moment[nearest] += q + m * (place[count] - place[nearest])
        mass[nearest] += m
        place[count], mass[count], moment[count] = place[fresh], mass[fresh], moment[fresh]
        mass[fresh], moment[fresh] = 0.0, 0.0
        return count
    return count + 1


@jit
def _age_density(
    place: Floats,
    mass: Floats,
    moment: Floats,
    tops: NDArray[np.int64],
    count: int,
    nodes: Floats,
    width: Floats,
    X: float,
    dX: float,
    ageing: tuple[float, float, float, float],
    newborn: float,
    work: Floats,
) -> int:
    """One step of all cohorts while the slider moves from `X` to ``X + dX`` at constant velocity.

    What breaks is born into the open cohort (row `count`). Returns the number of closed cohorts that are left.
    """
    dt, square, mean, D = ageing
    birth, share = 0, 0.0
    if newborn > 0.0:
        birth = min(max(int(np.searchsorted(nodes, newborn, side="right")) - 1, 1), nodes.size - 2)
        share = min(max((newborn - nodes[birth]) / (nodes[birth + 1] - nodes[birth]), 0.0), 1.0)
    # Pressed against the boundary for many relaxation times of the layer there, SDIRK2 would overshoot.
    fall = max(abs(dX) / dt - square * mean, 0.0)
    gamma = 0.5 if fall * fall * dt > 8.0 * D else 1.0 - np.sqrt(0.5)
    way = 8.0 * np.sqrt(2.0 * D * dt) + abs(dX)
    first, second, broken, dust, kept = 0.0, 0.0, 0.0, 0.0, 0
    for c in range(count):
        m, q = mass[c], moment[c]
        broken += np.sum(m)
        top = _top(m, q, nodes, tops[c], way)
        one, two = _advance_cohort(m, q, nodes, width, X - place[c], dX, ageing, gamma, top, (-1, 0.0, 0.0, 0.0), work)
        first += one
        second += two
        left = np.sum(m)
        broken -= left
        if left < 1e-13:  # as good as empty
            dust += left
            m[:], q[:] = 0.0, 0.0
            continue
        place[kept], tops[kept] = place[c], top
        if kept < c:
            mass[kept], moment[kept] = m, q
            m[:], q[:] = 0.0, 0.0
        kept += 1
    m, q = mass[count], moment[count]
    expected = np.sum(m) + broken
    top = max(_top(m, q, nodes, tops[count], way), birth + 1)
    _advance_cohort(m, q, nodes, width, X - place[count], dX, ageing, gamma, top, (birth, share, first, second), work)
    total = np.sum(m)
    if total > 0.0:  # rounding, and what was cut off below 0
        m *= expected / total
        q *= expected / total
    m[birth] += dust
    q[birth] += dust * (X + dX - place[count])
    if kept < count:
        place[kept], mass[kept], moment[kept] = place[count], m, q
        m[:], q[:] = 0.0, 0.0
    tops[kept] = top
    return kept


@jit
def _held(place: Floats, mass: Floats, moment: Floats, count: int, X: float) -> tuple[float, float]:
    """Force of the contacts, and the sum of the mass."""
    force, total = 0.0, 0.0
    for c in range(count + 1):
        here = np.sum(mass[c])
        total += here
        force += (X - place[c]) * here - np.sum(moment[c])
    return force, total


@jit
def advance_density(
    state: Floats,
    place: Floats,
    mass: Floats,
    moment: Floats,
    nodes: Floats,
    drive: Floats,
    slider: Floats,
    law: Floats,
    times: Floats,
    step: float,
    reach: float,
    pausing: bool = False,
) -> Floats:
    """Advance the kinetic equation of ageing contacts and the slider to the last of `times`, Eqs. (11), (13)-(17).

    The density over (place of birth, gap). A cohort is what was born while the slider moved by twice `reach`; of its
    contacts at each gap the mass is known and the mean place of birth, which is all that the force asks for: cohorts
    are needed only because an older contact ages by ``rate^2 (mean - gap - stretching)``, and the error of that falls
    as the square of their width. Gaps obey the Fokker-Planck equation of Eq. (17), in the frame of the moving
    boundary, with Chang-Cooper / Scharfetter-Gummel fluxes (conserving, Gaussian when at rest) and steps of second
    order. What breaks enters the open cohort; with ``newborn = 0`` by its boundary, which reflects: contacts there
    are born where the slider is. Second order in all: halve step, reach and cells together.

    Parameters
    ----------
    state : ndarray, shape (6,)
        Time, X, V, loss per time (see `advance_contacts`), number of closed cohorts, how far the contacts lag behind
        X. Changed in place.
    place : ndarray, shape (C,)
        Slider positions at which the cohorts have stretching 0, first the closed ones, then the open one. Changed in
        place. C is at least two more than there are closed cohorts; with ``(mean + 8 spread)/(reach mean) + 3``
        rows none has to be joined to another that is not near.
    mass : ndarray, shape (C, nodes)
        Share of contacts by cohort and gap, sum 1, kept to rounding; none on node 0 but of the open cohort. Changed in
        place.
    moment : ndarray, shape (C, nodes)
        The same times how much farther than `place` these contacts have been born on average. Changed in place.
    nodes : ndarray
        Of `gap_nodes`.
    drive, slider, law, times
        See `advance_contacts`.
    step : float
        Largest step in units of 1/rate^2.
    reach : float
        Largest way of the slider in a step, in units of `mean`.
    pausing : bool
        See `advance_contacts`.

    Returns
    -------
    ndarray, shape (m, 5)
        X, V, F_d, F_c, sum of the mass.
    """
    mean, newborn = law[1], law[3]
    rigid, square, D = np.isinf(slider[0]), law[0] ** 2, (law[0] * law[2]) ** 2
    now, X, V, loss, count, lag = state[0], state[1], state[2], state[3], int(state[4]), state[5]
    if rigid and times.size > 0:
        X = drive_at(drive, now)[0]
    width, work = gap_widths(nodes), np.zeros((10, nodes.size))
    tops = np.full(place.size, nodes.size - 1)
    F, total = _held(place, mass, moment, count, X)
    amplitude, samples, ramp, last = 0.0, np.empty((times.size, 5)), 0.0, 0.0
    filled = _fill(samples, 0, times, now, drive, slider, now, X, V, F, 1.0, 0.0, 0.0, total)
    while filled < times.size:
        X_0, V_0, F_0 = X, V, F
        end = min(times[filled if pausing else -1], drive_at(drive, now)[3])
        dt = _pace(now, end, drive, slider, V, 1.0, amplitude, step / square, reach * mean, 0.35)
        X, V, amplitude, shorter = _guess(drive, slider, now, X_0, V_0, F_0, 1.0, loss + 0.5 * ramp * last, ramp, dt)
        if shorter < dt or dt < end - now:
            dt, end = shorter, now + shorter
        # The contacts are moved to where the slider is guessed to go, from where it was last guessed to have gone.
        count = _age_density(
            place,
            mass,
            moment,
            tops,
            count,
            nodes,
            width,
            X_0 - lag,
            X - X_0 + lag,
            (dt, square, mean, D),
            newborn,
            work,
        )
        way = abs(X - place[count])
        if way >= 3.999 * reach * mean or (V * V_0 < 0.0 and way > 0.4 * reach * mean):
            soft = 2.0 * np.sqrt(D * dt) if newborn <= 0.0 else 0.0
            count = _close(place, mass, moment, nodes, count, X, 2.0 * reach * mean, soft)
            tops[count] = nodes.size - 1
        F, total = _held(place, mass, moment, count, X)
        before, loss = loss, (F_0 + X - X_0 - F) / dt
        ramp = 2.0 * (loss - before) / (dt + last) if last > 0.0 else 0.0
        start, last = loss - 0.5 * ramp * dt, dt
        if not rigid:
            lag = -X
            X, V, amplitude = _slide(drive, slider, now, X_0, V_0, F_0, 1.0, start, ramp, dt)
            lag += X
            F += lag
        filled = _fill(samples, filled, times, end, drive, slider, now, X_0, V_0, F_0, 1.0, start, ramp, total)
        now = end
    state[0], state[1], state[2], state[3], state[4], state[5] = now, X, V, loss, float(count), lag
    return samples


@jit
def pull_newborns(
    velocity: float, rate: float, spread: float, mean: float, distance: float, points: int, cells: int = 160
) -> tuple[Floats, Floats]:
    """Force while contacts that were all newborn at the start are dragged at constant velocity, Eqs. (7), (13)-(17).

    Lives at constant velocity are alike, so births (counted by local time) are a renewal process: ``births * S = 1``
    and ``F = births * (v a S)``, with the survivors S by age of the stationary solution and ``*`` the convolution.
    ``max(-dF/dX)`` is the effective stiffness of Fig. 11.

    Parameters
    ----------
    velocity, rate, spread, mean : float
        See `steady_friction`; newborn thresholds are 0.
    distance : float
        How far the slider goes.
    points : int
        Number of equal steps of the way.
    cells : int
        Cells of the gap.

    Returns
    -------
    way, force : ndarray, shape (points,)
    """
    u, delta = velocity / (rate * rate * mean), spread / mean
    z, age = _stability_nodes(u, delta, 0.0, cells)
    mass = _density_by_age(u, delta, 0.0, z, age)
    ages = np.linspace(0.0, distance / mean / u, points + 1)
    life, work = np.zeros(points + 1), np.zeros(points + 1)  # integrals of S and a S
    i, lives, works, s0 = 1, 0.0, 0.0, 1.0
    for j in range(age.size - 1):
        h, a0, s1 = age[j + 1] - age[j], age[j], np.sum(mass[j + 1])
        while i <= points and ages[i] <= age[j + 1]:
            # Cubic between the nodes: the derivatives are known.
            t = (ages[i] - a0) / h
            rise = (0.5 * h * (s0 + s1), 0.5 * h * (s0 * a0 + s1 * age[j + 1]))
            smooth, early, late = t * t * (3.0 - 2.0 * t), t * (1.0 - t) ** 2, t * t * (t - 1.0)
            life[i] = lives + smooth * rise[0] + h * (early * s0 + late * s1)
            work[i] = works + smooth * rise[1] + h * (early * s0 * a0 + late * s1 * age[j + 1])
            i += 1
        lives += 0.5 * h * (s0 + s1)
        works += 0.5 * h * (s0 * a0 + s1 * age[j + 1])
        s0 = s1
    life[i:], work[i:] = lives, works
    births, force = np.zeros(points), np.zeros(points)
    for i in range(points):
        known = 0.0
        for j in range(i):
            known += births[j] * (life[i - j + 1] - life[i - j])
        births[i] = (1.0 - known) / life[1]
        for j in range(i + 1):
            force[i] += births[j] * (work[i - j + 1] - work[i - j])
    return ages[1:] * u * mean, force * u * mean


# ---------------------------------------------------------------- the paper's closure


@jit
def threshold_edges(mean: float, spread: float, newborn: float, cells: float) -> Floats:
    """Edges of the threshold cells of the closure: `cells` per spread, eight times as many near zero.

    The last edge lies beyond all thresholds.
    """
    end = max(mean, newborn) + 8.0 * spread
    widest = spread / cells
    width = widest if newborn > 0.0 else widest / 8.0
    edges = np.empty(int(end / widest) + 100)
    edges[0] = 0.0
    k = 0
    while edges[k] < end and k + 1 < edges.size:
        edges[k + 1] = edges[k] + width
        width = min(1.06 * width, widest)
        k += 1
    return edges[: k + 1].copy()


@jit
def _cell(edges: Floats, place: float) -> int:
    """Cell that holds a place; the first or the last for places outside."""
    return min(max(int(np.searchsorted(edges, place, side="right")) - 1, 0), edges.size - 2)


@jit
def _threshold_rates(edges: Floats, drift: float, D: float, mean: float, up: Floats, down: Floats) -> None:
    """Rates between cells of threshold, no way out at either end; stationary for the Gaussian law, Eq. (17)."""
    n = edges.size - 1
    for i in range(n - 1):
        h = 0.5 * (edges[i + 2] - edges[i])
        a = drift * (mean - edges[i + 1])
        flow = D / h * _bernoulli(a * h / D)
        up[i] = (flow + a) / (edges[i + 1] - edges[i])
        down[i + 1] = flow / (edges[i + 2] - edges[i + 1])


@jit
def _relax(mass: Floats, up: Floats, down: Floats, dt: float, back: Floats) -> None:
    """Implicit step of thresholds that only age."""
    n = mass.size
    known = 0.0
    for i in range(n):
        pivot = 1.0 + dt * (up[i] + down[i])
        if i > 0:
            pivot -= dt * up[i - 1] * back[i - 1]
            known = (mass[i] + dt * up[i - 1] * known) / pivot
        else:
            known = mass[i] / pivot
        mass[i] = known
        back[i] = dt * down[i + 1] / pivot
    for i in range(n - 2, -1, -1):
        mass[i] += back[i] * mass[i + 1]


@jit
def closure_friction(
    velocity: Floats, rate: float, spread: float, newborn: float = 0.0, mean: float = 1.0, cells: float = 20.0
) -> Floats:
    """Force in smooth sliding by the paper's closure, Eqs. (1)-(3) with (18). An approximation.

    It keeps one law of thresholds for all contacts, whatever their stretching, and so drops the correlation between
    age and stretching: against `steady_friction` the force is 23 % too large at u = .01, 9 % too small at .5 and
    28 % too small at 1 (spread .1).

    In the steady state ``Q = Gamma J_c``, and P_c is the law of a threshold that has aged for an exponential time of
    rate ``Gamma v``; Gamma follows from ``Gamma <x_s> = 1`` by bisection. Thresholds are kept above 0.

    Parameters and return value as for `steady_friction`; `cells` is the number of cells per spread.
    """
    edges = threshold_edges(mean, spread, newborn, cells)
    n = edges.size - 1
    up, down, back, law = np.zeros(n + 1), np.zeros(n + 1), np.zeros(n + 1), np.zeros(n)
    _threshold_rates(edges, rate * rate, (rate * spread) ** 2, mean, up, down)
    birth = _cell(edges, newborn)
    force = np.zeros(velocity.size)
    for k in range(velocity.size):
        low, high = np.log(0.1 / edges[n]), np.log(10.0 / (0.5 * edges[1]))
        second = 0.0
        for _ in range(60):
            gamma = np.exp(0.5 * (low + high))
            law[:] = 0.0
            law[birth] = 1.0
            _relax(law, up, down, 1.0 / (gamma * abs(velocity[k])), back)
            first, second = 0.0, 0.0
            for i in range(n):
                a, b = edges[i], edges[i + 1]
                first += law[i] * 0.5 * (a + b)
                second += law[i] * (a * a + a * b + b * b) / 3.0
            if gamma * first > 1.0:
                high = np.log(gamma)
            else:
                low = np.log(gamma)
        force[k] = np.sign(velocity[k]) * 0.5 * np.exp(0.5 * (low + high)) * second
    return force


@jit
def advance_closure(
    state: Floats,
    place: Floats,
    weight: Floats,
    thresholds: Floats,
    edges: Floats,
    drive: Floats,
    slider: Floats,
    law: Floats,
    times: Floats,
    step: float,
    reach: float,
) -> Floats:
    """Advance the paper's closure, Eqs. (1)-(3) with (18), and the slider. An approximation.

    Q is kept as cohorts; each loses the share ``1 - J_c(x + dx)/J_c(x)`` of itself as its stretching grows, and the
    law of thresholds loses the same at the same place, ages, and is reborn at the newborn's threshold.

    Parameters
    ----------
    state : ndarray, shape (5,)
        Time, X, V, loss per time (see `advance_contacts`), number of cohorts; changed in place.
    place, weight : ndarray, shape (C,)
        Slider positions at which the cohorts have stretching 0, and their shares of contacts; changed in place.
    thresholds : ndarray, shape (cells,)
        Share of contacts by cell of threshold, sum 1; changed in place.
    edges : ndarray, shape (cells + 1,)
        Of `threshold_edges`.
    drive, slider, law, times, step, reach
        See `advance_density`.

    Returns
    -------
    ndarray, shape (m, 5)
        X, V, F_d, F_c, sum of the weights.
    """
    rate, mean, spread, newborn = law[0], law[1], law[2], law[3]
    rigid = np.isinf(slider[0])
    n = edges.size - 1
    now, X, V, loss, count = state[0], state[1], state[2], state[3], int(state[4])
    if rigid and times.size > 0:
        X = drive_at(drive, now)[0]
    up, down, back, beyond, swept = np.zeros(n + 1), np.zeros(n + 1), np.zeros(n + 1), np.zeros(n + 1), np.zeros(n)
    _threshold_rates(edges, rate * rate, (rate * spread) ** 2, mean, up, down)
    birth = _cell(edges, newborn)
    F, amplitude, reached = 0.0, 0.0, X  # reached: where the contacts have been moved to
    for c in range(count):
        F += weight[c] * (X - place[c])
    samples = np.empty((times.size, 5))
    filled = _fill(samples, 0, times, now, drive, slider, now, X, V, F, 1.0, 0.0, 0.0, np.sum(weight[:count]))
    while filled < times.size:
        X_0, V_0, F_0 = X, V, F
        end = min(times[-1], drive_at(drive, now)[3])
        dt = _pace(now, end, drive, slider, V, 1.0, amplitude, step / rate**2, reach * mean, 0.35)
        X, V, amplitude, shorter = _guess(drive, slider, now, X_0, V_0, F_0, 1.0, loss, 0.0, dt)
        if shorter < dt or dt < end - now:
            dt, end = shorter, now + shorter
        _relax(thresholds, up, down, dt, back)
        beyond[n] = 0.0
        for i in range(n - 1, -1, -1):
            beyond[i] = beyond[i + 1] + thresholds[i]
        swept[:] = 0.0
        born, total, kept = 0.0, 0.0, 0
        for c in range(count):
            a, b = abs(reached - place[c]), abs(X - place[c])
            if (X - place[c]) * (reached - place[c]) < 0.0:
                a = 0.0
            if b > a:
                i = _cell(edges, a)
                held = beyond[i] - thresholds[i] * (a - edges[i]) / (edges[i + 1] - edges[i])
                share = weight[c] / held if held > 1e-14 else 0.0
                gone = 0.0
                while i < n and edges[i] < b:
                    part = (min(b, edges[i + 1]) - max(a, edges[i])) / (edges[i + 1] - edges[i])
                    swept[i] += share * part
                    gone += share * part * thresholds[i]
                    i += 1
                if held <= 1e-14 or b >= edges[n]:
                    gone = weight[c]
                gone = min(gone, weight[c])
                weight[c] -= gone
                born += gone
            if weight[c] < 1e-14:
                born += weight[c]
                continue
            total += weight[c] * (X - place[c])
            place[kept], weight[kept] = place[c], weight[c]
            kept += 1
        count = kept
        for i in range(n):  # as e^-swept: the share that stays is positive
            part = -thresholds[i] * np.expm1(-swept[i])
            thresholds[i] -= part
            thresholds[birth] += part
        if count >= place.size:
            raise ValueError("no room for another cohort: hand in longer arrays")
        # Born all through the step: on average in its middle.
        place[count], weight[count] = 0.5 * (reached + X), born
        total += born * 0.5 * (X - reached)
        count += 1
        loss = (F_0 + X - X_0 - total) / dt
        F, reached = total, X
        if not rigid:
            X, V, amplitude = _slide(drive, slider, now, X_0, V_0, F_0, 1.0, loss, 0.0, dt)
            F += X - reached
        share = np.sum(weight[:count])
        filled = _fill(samples, filled, times, end, drive, slider, now, X_0, V_0, F_0, 1.0, loss, 0.0, share)
        now = end
    state[0], state[1], state[2], state[3], state[4] = now, X, V, loss, float(count)
    return samples


# ---------------------------------------------------------------- thresholds that grow by a fixed law


@jit
def grown(kind: int, first: float, second: float, age: float) -> tuple[float, float]:
    """Factor and addend of a growing threshold: ``f(age) = strength factor + addend``.

    Parameters
    ----------
    kind : int
        0, exponential growth from a newborn's threshold to the strength, ``f = s - (s - newborn) exp(-rate age)``;
        1, logarithmic growth from the strength, ``f = s + slope ln(1 + age/time)``.
    first, second : float
        ``rate, newborn`` or ``slope, time``.
    age : float

    Returns
    -------
    factor, addend : float
    """
    if kind == 0:
        young = np.exp(-first * age)
        return 1.0 - young, second * young
    return 1.0, first * np.log1p(age / second)


@jit
def growing_friction(
    velocity: Floats,
    kind: int,
    first: float,
    second: float,
    strengths: Floats,
    survival: Floats,
    delay: float = 0.0,
    steps: int = 4000,
) -> Floats:
    """Force in smooth sliding of contacts whose thresholds grow by a fixed law, by quadrature over the age.

    A contact of age ``a`` holds if its strength exceeds all ``(v a' - addend)/factor``, a' <= a (see `grown`).

    Parameters
    ----------
    velocity : ndarray, shape (n,)
        Sliding velocities, not 0.
    kind, first, second
        See `grown`.
    strengths, survival : ndarray, shape (m,)
        Share ``J_c`` of newborns whose strength exceeds the given one, ascending in strength; linear between.
    delay : float
        Mean time a broken contact stays detached.
    steps : int
        Steps of the age.

    Returns
    -------
    ndarray, shape (n,)
        Force per contact; 0 where contacts break as soon as they are born.
    """
    force = np.zeros(velocity.size)
    top = strengths[-1]
    for k in range(velocity.size):
        v = abs(velocity[k])
        end = (top + second) / v if kind == 0 else 2.0 * top / v
        if kind == 1:
            for _ in range(200):  # where even the strongest contact has broken
                factor, addend = grown(kind, first, second, end)
                if v * end > top + addend:
                    break
                end *= 1.5
        h = end / steps
        life, work, most, before = 0.0, 0.0, -np.inf, 1.0
        if kind == 0 and second <= 0.0:
            most = v / first  # the start: threshold and stretching grow in proportion
            before = np.interp(most, strengths, survival)
        for j in range(1, steps + 1):
            a = j * h
            factor, addend = grown(kind, first, second, a)
            most = max(most, (v * a - addend) / factor)
            now = 1.0 if most < strengths[0] else (0.0 if most > top else np.interp(most, strengths, survival))
            life += 0.5 * h * (before + now)
            work += 0.5 * h * (before * (a - h) + now * a)
            before = now
        if life > 0.0:
            force[k] = np.sign(velocity[k]) * v * work / (life + delay)
    return force


@jit
def advance_growing(
    state: Floats,
    stretching: Floats,
    strength: Floats,
    attach: Floats,
    drive: Floats,
    slider: Floats,
    law: Floats,
    pool: Floats,
    delays: Floats,
    times: Floats,
    reach: float,
    rng: np.random.Generator,
    pausing: bool = False,
) -> Floats:
    """Advance N contacts whose thresholds grow by a fixed law (`grown`), and the slider of Eq. (11).

    Inside a step the slider's velocity is constant; the gap is then concave in time, so a contact breaks in the step
    exactly if its gap is below 0 at the end, at a moment found by bisection.

    Parameters
    ----------
    state : ndarray, shape (4,)
        Time, X, V, loss per time (see `advance_contacts`); changed in place.
    stretching, strength, attach : ndarray, shape (N,)
        Stretchings, strengths, and the times from which contacts hold or will hold (their births: the age of a
        contact is the time since); changed in place.
    drive, slider
        See `advance_contacts`.
    law : ndarray, shape (3,)
        kind, first, second of `grown`.
    pool : ndarray, shape (p,)
        Strengths of newborns, one drawn at random for each birth.
    delays : ndarray, shape (d,)
        Delays after breaking, one drawn at random for each break; ``[0.]`` for none.
    times, rng, pausing
        See `advance_contacts`.
    reach : float
        Largest way of the slider in a step.

    Returns
    -------
    ndarray, shape (m, 5)
        X, V, F_d, F_c, share of attached contacts.
    """
    kind, first, second = int(law[0]), law[1], law[2]
    unready, strongest = kind == 0 and second <= 0.0, np.max(pool)
    rigid = np.isinf(slider[0])
    n = stretching.size
    now, X, V, loss = state[0], state[1], state[2], state[3]
    if rigid and times.size > 0:
        X = drive_at(drive, now)[0]
    total, count = 0.0, 0
    for i in range(n):
        if attach[i] <= now:
            total += stretching[i]
            count += 1
    amplitude, samples = 0.0, np.empty((times.size, 5))
    filled = _fill(samples, 0, times, now, drive, slider, now, X, V, total / n, 1.0, 0.0, 0.0, count / n)
    while filled < times.size:
        X_0, V_0, F, grip = X, V, total / n, count / n
        end = min(times[filled if pausing else -1], drive_at(drive, now)[3])
        dt = _pace(now, end, drive, slider, V, grip, amplitude, end - now, reach, 0.35)
        X, V, amplitude, shorter = _guess(drive, slider, now, X_0, V_0, F, grip, loss, 0.0, dt)
        if shorter < dt or dt < end - now:
            dt, end = shorter, now + shorter
        v = (X - X_0) / dt
        hopeless = unready and strongest * first <= abs(v)
        total, held = 0.0, 0
        for i in range(n):
            x, start = stretching[i], now
            if attach[i] > now:
                if attach[i] >= end:
                    continue
                x, start = 0.0, attach[i]
            tries = 0
            while start < end:
                factor, addend = grown(kind, first, second, end - attach[i])
                if abs(x + v * (end - start)) < strength[i] * factor + addend:
                    x += v * (end - start)
                    start = end
                    break
                low, high = start, end
                # A threshold that grows from 0 more slowly than the stretching never leads it.
                at_once = x == 0.0 and attach[i] == start and unready and strength[i] * first <= abs(v)
                if at_once:
                    high = start
                for _ in range(0 if at_once else 40):
                    middle = 0.5 * (low + high)
                    factor, addend = grown(kind, first, second, middle - attach[i])
                    if abs(x + v * (middle - start)) < strength[i] * factor + addend:
                        low = middle
                    else:
                        high = middle
                x = 0.0
                strength[i] = pool[int(rng.random() * pool.size)]
                start = high + delays[int(rng.random() * delays.size)]
                attach[i] = start
                tries += 1
                if (tries > 100 or hopeless) and attach[i] < end:  # breaks as soon as it is born
                    attach[i] = start = end
            stretching[i] = x
            if start == end:
                total += x
                held += 1
        loss = (F + grip * (X - X_0) - total / n) / dt
        count = held
        if not rigid:
            X_1 = X
            X, V, amplitude = _slide(drive, slider, now, X_0, V_0, F, grip, loss, 0.0, dt)
            total += count * (X - X_1)
            for i in range(n):
                if attach[i] <= end:
                    stretching[i] += X - X_1
        filled = _fill(samples, filled, times, end, drive, slider, now, X_0, V_0, F, grip, loss, 0.0, count / n)
        now = end
    state[0], state[1], state[2], state[3] = now, X, V, loss
    return samples
