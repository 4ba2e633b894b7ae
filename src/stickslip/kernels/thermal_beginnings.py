"""Where runs of thermal cohorts begin: on given stretchings, or in steady sliding."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .survival import value_at
from .thermal_cohorts import (
    ALIVE,
    ATTACHED,
    BIRTH,
    CONTACT_FORCE,
    EXTINCT,
    FORCE,
    MASS,
    NEXT_STEP,
    OUTSIDE,
    REACH,
    ROWS,
    SCALARS,
    SINCE,
    SLID,
    STORED,
    TRIAL_REACH,
    VELOCITY,
    Delays,
    Model,
    State,
    follow,
    untouched,
)

Array = NDArray[np.float64]


def initial_state(model: Model, delays: Delays, x: Array, weight: Array, since: float, velocity: float) -> State:
    """Put a slider at 0 on contacts of these stretchings, whose thresholds lie beyond them; the rest is detached."""
    count = x.size
    state = _empty(model, delays, 2 * count + 256, 0.0)
    cohort = state.cohort
    reach = np.abs(x)
    held = np.array([max(value_at(model.thresholds, float(r)), 1e-12) for r in reach])
    cohort[BIRTH, :count], cohort[SINCE, :count] = -x, since
    cohort[ALIVE, :count], cohort[REACH, :count] = weight, reach
    state.run[:count] = untouched(model)
    cohort[MASS, :count] = weight / held
    if model.node.size:
        for j in range(count):
            above = model.node > reach[j]
            state.run[j, ~above] = np.inf
            cohort[MASS, j] = weight[j] / max(float(model.weight[above].sum()), 1e-12)
    return _summed(state, count, velocity)


def sliding_state(model: Model, delays: Delays, velocity: float, step: float, f_d: float) -> State:
    """Put a slider at 0 in steady sliding on its contacts: newborns taken along step by step until none is left."""
    mean = float((delays.time * delays.weight).sum()) if delays.time.size else math.inf
    state = _empty(model, delays, 1024, 0.0)
    for _ in range(4):  # most newborns should not break before the first step is over
        state.run[0, :], state.cohort[REACH, 0] = untouched(model), 0.0
        if follow(state, model, 0, 0.0, step / velocity, 0.0, step) > 0.97:
            break
        step *= 0.5
    state.run[0, :], state.cohort[REACH, 0] = untouched(model), 0.0
    alive, runs, reaches = [1.0], [state.run[0].copy()], [0.0]
    while alive[-1] > EXTINCT:
        done = len(alive) - 1
        fraction = follow(state, model, 0, done * step / velocity, step / velocity, done * step, step)
        state.run[0], state.cohort[REACH, 0] = state.trial[0], state.cohort[TRIAL_REACH, 0]
        alive.append(min(fraction, alive[-1]))
        runs.append(state.run[0].copy())
        reaches.append(float(state.cohort[REACH, 0]))
    count = len(alive) - 1
    left = np.array(alive[:count])
    share = np.full(count, step)
    share[0] *= 0.5
    length = float((share * left).sum())
    share /= length + velocity * mean
    state = _empty(model, delays, 2 * count + 256, velocity / (length + velocity * mean))
    x = step * np.arange(count)
    cohort = state.cohort
    order = slice(count)
    cohort[BIRTH, order], cohort[SINCE, order] = -x[::-1], -x[::-1] / velocity
    cohort[MASS, order], cohort[ALIVE, order] = share[::-1], (share * left)[::-1]
    cohort[REACH, order], state.run[order] = np.array(reaches[:count])[::-1], np.array(runs[:count])[::-1]
    state.scalar[SLID] = f_d
    return _summed(state, count, velocity)


def _empty(model: Model, delays: Delays, room: int, rate_before: float) -> State:
    """Make room for a state; contacts broke at this rate before."""
    wide = max(model.node.size, 1)
    broken = np.zeros((2, 1024))
    memory = max([1.0, *delays.time])
    broken[:, 0] = -memory, -rate_before * memory
    run = np.zeros((room, wide))
    return State(
        np.zeros(SCALARS), np.zeros((ROWS, room)), run, run.copy(), broken, np.zeros(delays.time.size, np.int64),
        np.array([0, 2], np.int64),
    )  # fmt: skip


def _summed(state: State, count: int, velocity: float) -> State:
    scalar, alive, x = state.scalar, state.cohort[ALIVE, :count], -state.cohort[BIRTH, :count]
    state.used[0] = count
    scalar[VELOCITY], scalar[NEXT_STEP] = velocity, math.inf
    scalar[FORCE], scalar[ATTACHED] = float((alive * x).sum()), float(alive.sum())
    out = 1.0 - scalar[ATTACHED]
    scalar[OUTSIDE] = out
    scalar[CONTACT_FORCE] = scalar[FORCE] + out * scalar[SLID]
    scalar[STORED] = 0.5 * float((alive * x * x).sum()) + 0.5 * out * scalar[SLID] ** 2
    return state
