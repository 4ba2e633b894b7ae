"""Measured traces: their slips and regime, and the rig behind them by `quick_fit` and
by `fit`; without state.
"""

import math
import os
import re
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from stickslip import fitting, io, measure, sliding
from stickslip.errors import InputError, instance, number, whole
from stickslip.explorer import documents
from stickslip.explorer.plain import Array, Plain, Watch, force_trace, packed, width_of
from stickslip.fitting import force_unit_in_newtons, time_unit_in_seconds
from stickslip.model import Assumption, Contacts, Rig, constant, read_value
from stickslip.plot import envelope
from stickslip.simulation import simulate
from stickslip.words import engineering, listed

_COARSE = 2_000  # draws of a table that is quick to make
_SHOWN = 8  # slips in the overlay
_SERIES = 60  # series of slips that give the distribution of drops
_OVERLAID = 3  # simulated traces drawn beside the measured one
_DAMPING = 0.15


def trace(request: Plain, watch: Watch) -> Iterator[Plain]:
    """Yield the columns of a file that may be chosen, and the measured trace in it."""
    watch(0.0)
    with suppress(InputError):  # `_read` below reports the mistake
        yield {"columns": measure.columns(request["content"])}
    data = _read(request)
    about = {
        "name": _name(request),
        "rows": int(data.attrs["rows"]),
        "note": data.attrs["note"],
    }
    yield force_trace(data, width_of(request)) | about


def _name(request: Plain) -> str:
    return Path(str(request.get("name", ""))).name[:100] or "trace"


def _options(request: Plain) -> dict[str, str]:
    """Return the fields that were filled in: the columns (force, time) or the time
    between rows (step), and the known values for a fit.
    """
    instance("options", options := request.get("options", {}), dict, "a table of texts")
    return {key: text for key, value in options.items() if (text := str(value).strip())}


_FIELDS = {"force": "force column", "time": "time column", "step": "seconds per row"}


def _read(request: Plain) -> xr.Dataset:
    """Return the trace of a request, from its content and the named columns."""
    given: dict[str, Any] = {
        name: text for name, text in _options(request).items() if name in _FIELDS
    }
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "trace"
        file.write_bytes(request["content"])
        try:
            return measure.read_trace(file, **given)
        except InputError as error:
            words = str(error).replace(str(file), _name(request))
            fields = re.sub(
                r"\(--(\w+)[^)]*\)",
                lambda option: f"(in the field {_FIELDS[option[1]]})",
                words,
            )
            raise InputError(fields) from None


def sample(_request: Plain, _watch: Watch) -> Iterator[Plain]:
    """Yield a trace for trial: slips of a known rig, as recorded by a force sensor with
    noise.
    """
    run = fitting.synthetic_trace()
    rows = [
        f"{t:.3f},{F:.4f}"
        for t, F in zip(run["time"].values, run["spring_force"].values, strict=True)
    ]
    yield {"text": "\n".join(["time [s],force [N]", *rows, ""])}


def fit(request: Plain, watch: Watch) -> Iterator[Plain]:
    """Yield the readings of a trace, the rig that they give in closed form, and the
    time that intervals would take.
    """
    watch(0.0)
    events = fitting.pick_events(_read(request))
    given = _options(request)
    zeta = read_value(
        "damping ratio", given.get("damping", _DAMPING), "1", "0.15", bare=True
    )
    number("damping ratio", zeta, at_most=0.95)
    overshoot = math.exp(-math.pi * zeta / math.sqrt(1.0 - zeta**2))
    force = force_unit_in_newtons(events, {})
    # During a slip the slider oscillates about the friction force, and overshoots it
    # downwards by a fraction that depends on the damping.
    in_slips = (
        force
        * (float(events.troughs.mean()) + overshoot * events.mean_peak)
        / (1.0 + overshoot)
    )
    static = events.mean_peak * force
    least, most = fitting.friction_ratio_range()
    fast = in_slips < static / most
    readings = {
        "static": static,
        "kinetic": static / math.sqrt(least * most) if fast else in_slips,
        "rate": events.loading_rate * force / time_unit_in_seconds(events),
    }
    yield {
        "slips": str(events).splitlines(),
        "readings": {key: f"{value:.4g}" for key, value in readings.items()},
    }
    if missing := [title for key, title in _NEEDED.items() if key not in given]:
        yield {
            "missing": (
                f"For a rig, give {listed(missing)}: a force trace alone gives "
                "no length, time or mass."
            )
        }
    else:
        known = (
            readings
            | ({"in slips": in_slips} if fast else {})
            | given
            | {"damping": zeta}
        )
        yield {"quick": _quick(events, known, documents.seconds_of(request), watch)}
    yield {"table": _plan(events)}


_FAST = (
    "slips are too fast to show kinetic friction; it is taken amid what contacts "
    "can make: slide slowly, and give it"
)
_NEEDED = {
    "stiffness": "the stiffness of the driving spring",
    "speed": "its speed",
    "mass": "the mass of the slider",
}


def _quick(
    events: fitting.Events, given: Mapping[str, Any], seconds: float, watch: Watch
) -> Plain:
    rig = fitting.quick_fit(
        static_friction=given["static"],
        kinetic_friction=given["kinetic"],
        loading_rate=given["rate"],
        half_speed=given.get("half"),
        damping_ratio=given["damping"],
        **{key: given[key] for key in _NEEDED},
    )
    assumed = dict(rig.assumed)
    if "in slips" in given and isinstance(given["kinetic"], float):
        assumed["interface.thresholds"] = Assumption("", _FAST)
    # The delay is that of a slip: with a shorter one contacts hold again within the
    # slip, with a longer one they hold too late.
    if "half" not in given:
        lasts = events.slip_samples * events.step * time_unit_in_seconds(events)
        how = "as long as a slip was recorded to last"
        # Detached for the delay, contacts carry less force the faster they slide.
        if given.get("in slips", 0.0) > 0:
            slow = rig.unit("f_s") * float(
                sliding.kinetic_friction(rig.natural.interface, 1.0)
            )
            slip = (
                float(events.drops.mean())
                * force_unit_in_newtons(events, {})
                / rig.value("stiffness")
            )
            lasts *= (slow / given["in slips"] - 1.0) * rig.unit("x_s") / slip
            how = "by the friction in slips beside that of slow sliding"
        delay = float(f"{lasts:.3g}")
        how = f"{how}; the speed at which friction has halved gives it"
        assumed["interface.delay"] = Assumption(engineering(delay, "s", 3), how)
        rig = rig.with_values(delay=delay)
    rig = replace(rig, assumed=assumed)
    standard_deviation = rig.interface.threshold_distribution.standard_deviation()
    overlay, words, fits = _overlay(rig, events, seconds, watch)
    return {
        **_rig(rig),
        "words": words,
        "fits": fits,
        "numbers": [
            ["total contact strength, N f_s", rig.in_units(1.0, "force")],
            ["breaking displacement, x_s", rig.in_units(1.0, "length")],
            [
                "standard deviation of the thresholds, over their mean",
                f"{standard_deviation:.2g}",
            ],
            [
                "delay of re-attachment",
                rig.in_units(rig.interface.delay.moment(1), "time"),
            ],
        ],
        "assumed": [f"{key}: {item}" for key, item in rig.assumed.items()],
        "overlay": overlay,
    }


def _rig(rig: Rig) -> Plain:
    """Return a rig for the page Simulate, and as a file with the draws of its fit."""
    return {
        "document": documents.of(replace(rig, fitted={})),
        "toml": io.to_toml(rig),
    }


def _overlay(
    rig: Rig, events: fitting.Events, seconds: float, watch: Watch
) -> tuple[Plain, str, bool]:
    """Return several slips of the trace beside those of a rig in sustained stick-slip,
    the comparison as text, and whether the rig fits.
    """
    begin, end, first = _window(events)
    unit = time_unit_in_seconds(events)
    settle = 3.0 * events.recurrence
    lasts = (settle + 1.5 * (end - begin)) * unit
    long = replace(
        rig,
        drive=constant(rig.natural.velocity, lasts / rig.unit("time")),
        method=Contacts(1_000, seed=1),
    )
    short = documents.shortened(long, seconds)
    documents.check_size(short, seconds)
    run = simulate(short, progress=watch)
    t = run["time"].values / unit
    F = run["spring_force"].values / force_unit_in_newtons(events, {})
    made = xr.Dataset(
        {"spring_force": ("time", F, {"units": events.force_unit})},
        {"time": ("time", t, {"units": events.time_unit})},
    )
    try:
        slips = fitting.pick_events(
            made, minimum_drop=events.smallest, after=min(settle, 0.5 * float(t[-1]))
        )
        comparison, fits = fitting.compared(slips, events)
        words = (
            f"This rig {'fits' if fits else 'does not fit'}: {comparison} "
            "(mean drop and period, at 90 % confidence)."
        )
        if not fits and slips.drops.mean() > events.drops.mean():
            words += (
                " These formulas assume that sliding contacts carry no force; the "
                "fit with intervals does not."
            )
        shift = first - float(slips.time[slips.peak_at[0]])
    except InputError:
        drop = f"{float(events.drops.mean()):.3g} {events.force_unit}".rstrip()
        fits = False
        words = (
            "This rig does not fit: its run hardly slips, the trace has drops of "
            f"{drop}."
        )
        shift = begin - settle
    seen = (t + shift >= begin) & (t + shift <= end)
    return _beside(events, [line(t[seen] + shift, F[seen])], begin, end), words, fits


def _window(events: fitting.Events) -> tuple[float, float, float]:
    """Return the begin and the end of the overlay, in the trace's unit of time, and the
    begin of its first slip.
    """
    at = max((len(events) - _SHOWN) // 2, 0)
    first = float(events.time[events.peak_at[at]])
    begin = first - 0.5 * events.recurrence
    return begin, begin + (_SHOWN + 0.2) * events.recurrence, first


def _beside(
    events: fitting.Events, series: list[Plain], begin: float, end: float
) -> Plain:
    """Return a part of the trace and simulated forces beside it, in the units of the
    trace.
    """
    seen = (events.time >= begin) & (events.time <= end)
    return {
        "time": {"title": "time", "unit": events.time_unit},
        "force": {"title": "force", "unit": events.force_unit},
        "series": series,
        "trace": line(events.time[seen], events.force[seen]),
        "span": [begin, end],
    }


def line(x: Array, y: Array) -> Plain:
    """Return a line, thinned to the width of a screen."""
    x, y = envelope(x, y, 2_400)
    return {"x": packed(x), "y": packed(y)}


def _plan(events: fitting.Events) -> Plain:
    """Return the seconds that a fit with intervals takes for each size of its table; or
    the reason why it is impossible.
    """
    try:
        fitting.check(events)
    except InputError as error:
        return {"refused": str(error)}
    ready = fitting.draws_kept()
    each = fitting.seconds_per_draw() / (os.cpu_count() or 1)
    return {
        "sizes": [
            {"draws": draws, "seconds": max(draws - ready, 0) * each}
            for draws in (_COARSE, fitting.DRAWS)
        ]
    }


def posterior(request: Plain, watch: Watch) -> Iterator[Plain]:
    """Fit a trace; yield the interval of each parameter, series of draws, and a rig."""
    watch(0.0)
    events = fitting.pick_events(_read(request))
    options = _options(request)
    draws = whole(
        "draws", request.get("draws"), at_least=_COARSE, at_most=fitting.DRAWS
    )
    if not request.get("table") and fitting.draws_kept() < draws:
        raise InputError(
            "intervals need a table of simulations that takes minutes; a shared "
            "explorer does not make it: run "
            "`stickslip fit` on this machine once, or a fit in an explorer that is not "
            "shared"
        )
    known = {key: options[key] for key in _NEEDED if key in options}
    if "speed" in known:  # the name in `quick_fit`
        known["velocity"] = known.pop("speed")
    found = fitting.fit(events, known=known, draws=draws, progress=watch)
    try:
        rig = _rig(found.rig(name=f"fit of {_name(request)}"))
    except InputError as error:
        rig = {"no_rig": str(error)}
    yield {
        **rig,
        "parameters": [
            {
                "title": one.title,
                "text": str(one),
                "says": _VERDICTS[str(one.verdict)],
                "prior": "{:g} to {:g}".format(*getattr(found.prior, one.key)),
                # ends of the interval as fractions of the prior, 0 to 1
                "part": list(one.parts or ()),
            }
            for one in found.parameters
        ],
        "quantities": [[one.title, str(one)] for one in found.quantities],
        "notes": list(found.notes),
        "overlay": _predicted(found, events),
        "drops": _drops(found, events),
        "test": found.test.assign(here=found.test["here"].clip(-4.0, 4.0))
        .reset_index()
        .to_dict("records"),
    }


_VERDICTS = {
    "identified": "identified: the trace determines it",
    "weak": "weak: the trace determines it poorly",
    "not identified": (
        "not identified: the interval is hardly narrower than the range that was "
        "considered possible"
    ),
    "at a bound": "at a bound of the range considered possible",
}


def _predicted(found: fitting.Fit, events: fitting.Events) -> Plain:
    """Return several slips of the trace, and equally long parts of traces from some
    draws, with the same loading.
    """
    begin, end, _ = _window(events)
    series = []
    for row in range(min(_OVERLAID, len(found))):
        rng = np.random.default_rng([0, row])
        made = fitting.sampled(
            *found.series(row, 5 * _SHOWN, rng),
            events.loading_rate,
            events.step,
            0.0,
            rng,
        )
        t = made["time"].values
        F = made["spring_force"].values
        late = t >= t[-1] - (end - begin)
        series.append(line(begin + t[late] - t[late][0], F[late]))
    return _beside(events, series, begin, end)


def _drops(found: fitting.Fit, events: fitting.Events) -> Plain:
    """Return the fraction of the slips up to each drop, for the trace and for series of
    as many slips from the draws.
    """
    at = np.linspace(0.0, 1.25 * float(events.drops.max()), 120)
    below = []
    for row in range(min(_SERIES, len(found))):
        drops = np.subtract(
            *found.series(row, min(len(events), 400), np.random.default_rng([0, row]))
        )
        if (drops := drops[drops >= events.smallest]).size:
            below.append((drops[:, None] <= at).mean(axis=0))
    low, high = np.quantile(below, (0.05, 0.95), axis=0)
    return {
        "drop": {
            "title": "force drop",
            "unit": events.force_unit,
            "values": packed(at),
        },
        "trace": packed((events.drops[:, None] <= at).mean(axis=0)),
        "low": packed(low),
        "high": packed(high),
    }
