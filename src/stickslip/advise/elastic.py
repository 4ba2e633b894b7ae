"""Which wavelength of an elastic slider slips first, and at which speeds: the answer of linear theory, mode by mode."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from stickslip.advise.answer import ElasticPrediction, WaveAnswer
from stickslip.advise.bands import CANNOT_GROW, fastest_mode, scaled, stability_along
from stickslip.advise.say import MOST_MODES
from stickslip.advise.speeds import range_of_speeds
from stickslip.errors import UndecidedError
from stickslip.model import Chain, ElasticBody
from stickslip.model.drive import constant
from stickslip.model.parameters import VELOCITY
from stickslip.model.rig import Rig
from stickslip.progress import Progress
from stickslip.sliding import respond
from stickslip.stability import count_unstable

_MODES = 5
"""Modes that are told of, of different stiffness, the softest first."""


def predict_waves(rig: Rig, report: Progress = lambda _share: None) -> ElasticPrediction:
    """Say which waves of an elastic slider grow at the speed of its drive, and at which speeds."""
    from stickslip.elastic.modes import critical_length, sliders_of  # some .13 s that no rigid rig needs

    low, high = range_of_speeds(rig)
    found = ElasticPrediction(rig=rig, speeds_searched=(low * rig.velocity, high * rig.velocity))
    stiffness, coupling, wavelength, sliders = sliders_of(rig.slider, MOST_MODES)
    sliding = [replace(rig, slider=slider, drive=constant(rig.natural.velocity)) for slider in sliders]
    first = [i for i in range(len(sliders)) if sliders[i] not in sliders[:i]]  # modes come in pairs of one stiffness
    try:
        if respond(rig.interface).inert:
            raise UndecidedError(CANNOT_GROW)
        grows = {sliders[i]: count_unstable(sliding[i]) > 0 for i in first}

        def waves() -> Iterator[WaveAnswer]:
            for done, i in enumerate(first[:_MODES]):
                report(done / _MODES)
                growth, frequency = fastest_mode(sliding[i])
                bands = stability_along(sliding[i], ((VELOCITY, 1),), low, high)
                told = scaled((band for band in bands if band.kind == "unstable"), rig.velocity)
                yield WaveAnswer(
                    name=_name(float(wavelength[i]), float(coupling[i]), rig.slider),
                    wavelength=float(wavelength[i]),
                    stiffness=float(stiffness[i]) * rig.unit("k"),
                    growth=growth,
                    frequency=frequency,
                    speeds=tuple((band.low, band.high) for band in told),
                )

        found = replace(
            found,
            growing=sum(grows[slider] for slider in sliders),
            waves=tuple(waves()),
            critical=critical_length(rig) if isinstance(rig.slider, Chain) else None,
        )
    except UndecidedError as reason:
        found = replace(found, theory_note=str(reason))
    report(1.0)
    return found


def _name(wavelength: float, coupling: float, body: ElasticBody) -> str:
    if math.isnan(wavelength):
        return "a mode localised at the driven end"
    if isinstance(body, Chain) and body.size < wavelength < math.inf:
        # No wave is longer than what carries it.
        return "the bar nearly as a whole" if wavelength > 3.0 * body.size else "half a wave along the bar"
    if math.isfinite(wavelength):
        return f"waves of {wavelength:.3g} blocks"
    return "the uniform mode" if coupling == 0.0 else "waves across the drive"
