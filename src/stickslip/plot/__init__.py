"""Pictures of Datasets, as matplotlib Axes.

Every function draws the content of a Dataset, a run of the model or a measured trace,
in its own units: labels come from ``long_name`` and ``units`` of the variables. Without
`ax` a function makes a new figure; write it with `save`:

>>> interface = ss.Interface(thresholds=ss.Gaussian(mean=1.0, std=0.1))
>>> rig = ss.Rig(
...     interface,
...     ss.Slider(stiffness=2.0, mass=1e-3, damping=20.0),
...     ss.constant(1.0, duration=3),
... )
>>> run = ss.simulate(rig)
>>> from stickslip.plot import overview, save
>>> save(overview(run), "run.png").name
'run.png'

Figures are plain `matplotlib.figure.Figure` objects, which pyplot does not manage: they
need not be closed, and need no window system. The module itself can be called:
``ss.plot(run)`` is ``ss.plot.overview(run)``, and ``ss.plot(answer)`` the picture of a
prediction, a chart, a fit or any other answer that has one.
"""

import sys
from types import ModuleType

import xarray as xr
from matplotlib.figure import Figure

from stickslip.answers import Answer
from stickslip.errors import InputError
from stickslip.plot.elastic import (
    elastic_overview,
    front_curve,
    fronts,
    precursor_lengths,
    precursors,
    slip_profiles,
    spacetime,
)
from stickslip.plot.film import contacts, sound
from stickslip.plot.fits import (
    fitted,
    friction_at_speeds,
    peaks_after_holds,
    slips,
    steps_and_holds,
    velocity_step,
)
from stickslip.plot.maps import chart, sweep_picture
from stickslip.plot.palette import (
    BLACK,
    BLUE,
    COLUMN,
    DASHED,
    GREEN,
    GREY,
    ORANGE,
    PAGE,
    PALETTE,
    SKY,
    VERMILLION,
)
from stickslip.plot.prediction import prediction, waves
from stickslip.plot.replay import Frames, frames, lasting
from stickslip.plot.runs import (
    attached,
    energy,
    force_trace,
    overview,
    part,
    phase_portrait,
    side_by_side,
    velocity,
)
from stickslip.plot.style import (
    drawn,
    envelope,
    format_of,
    house_style,
    label,
    legend_above,
    new_figure,
    panel,
    save,
    unit_text,
)
from stickslip.plot.surface import contact_sizes, surface, surface_map

__all__ = [
    "BLACK",
    "BLUE",
    "COLUMN",
    "DASHED",
    "GREEN",
    "GREY",
    "ORANGE",
    "PAGE",
    "PALETTE",
    "SKY",
    "VERMILLION",
    "Frames",
    "attached",
    "chart",
    "contact_sizes",
    "contacts",
    "drawn",
    "elastic_overview",
    "energy",
    "envelope",
    "fitted",
    "force_trace",
    "format_of",
    "frames",
    "friction_at_speeds",
    "front_curve",
    "fronts",
    "house_style",
    "label",
    "lasting",
    "legend_above",
    "new_figure",
    "overview",
    "panel",
    "part",
    "peaks_after_holds",
    "phase_portrait",
    "precursor_lengths",
    "precursors",
    "prediction",
    "save",
    "side_by_side",
    "slip_profiles",
    "slips",
    "sound",
    "spacetime",
    "steps_and_holds",
    "surface",
    "surface_map",
    "sweep_picture",
    "unit_text",
    "velocity",
    "velocity_step",
    "waves",
]


class _Plot(ModuleType):
    """A module that draws its argument when it is called."""

    def __call__(self, what: object) -> Figure:
        """Draw an overview of a run, a measured trace or a sweep, or the picture of an
        answer.
        """
        if isinstance(what, xr.Dataset):
            return sweep_picture(what) if "regime" in what else overview(what)
        if isinstance(what, Answer) and hasattr(what, "plot"):
            figure: Figure = what.plot()
            return figure
        raise InputError(
            f"plot: there is no picture of {type(what).__name__}: give a run, trace, "
            "sweep or answer"
        )


sys.modules[__name__].__class__ = _Plot
