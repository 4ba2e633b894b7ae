"""Pictures: a Dataset in, matplotlib Axes out.

Every function draws what the Dataset holds, a run of the model or a measured trace, in its own units: labels come from
``long_name`` and ``units`` of the variables. Without `ax` a function makes a figure of its own; write it with `save`:

>>> import stickslip as ss
>>> interface = ss.Interface(thresholds=ss.Gaussian(mean=1.0, std=0.1))
>>> rig = ss.Rig(interface, ss.Slider(stiffness=2.0, mass=1e-3, damping=20.0), ss.constant(1.0, duration=3))
>>> run = ss.simulate(rig)
>>> from stickslip.plot import overview, save
>>> save(overview(run), "run.png").name
'run.png'

Figures are plain `matplotlib.figure.Figure` objects, unknown to pyplot: nothing to close, no window system needed.
The module itself can be called: ``ss.plot(run)`` is ``ss.plot.overview(run)``, and ``ss.plot(answer)`` the picture of
a prediction, a chart, a fit or any other answer that has one.
"""

import sys
from types import ModuleType

import xarray as xr
from matplotlib.figure import Figure

from stickslip.answers import Answer
from stickslip.errors import InputError
from stickslip.plot.elastic import elastic_overview as elastic_overview
from stickslip.plot.elastic import front_curve as front_curve
from stickslip.plot.elastic import fronts as fronts
from stickslip.plot.elastic import precursor_lengths as precursor_lengths
from stickslip.plot.elastic import precursors as precursors
from stickslip.plot.elastic import slip_profiles as slip_profiles
from stickslip.plot.elastic import spacetime as spacetime
from stickslip.plot.fits import fitted as fitted
from stickslip.plot.fits import peaks_after_holds as peaks_after_holds
from stickslip.plot.fits import slips as slips
from stickslip.plot.fits import velocity_step as velocity_step
from stickslip.plot.maps import chart as chart
from stickslip.plot.maps import sweep_picture as sweep_picture
from stickslip.plot.prediction import prediction as prediction
from stickslip.plot.prediction import waves as waves
from stickslip.plot.runs import attached as attached
from stickslip.plot.runs import energy as energy
from stickslip.plot.runs import force_trace as force_trace
from stickslip.plot.runs import overview as overview
from stickslip.plot.runs import phase_portrait as phase_portrait
from stickslip.plot.runs import side_by_side as side_by_side
from stickslip.plot.runs import velocity as velocity
from stickslip.plot.style import BLACK as BLACK
from stickslip.plot.style import BLUE as BLUE
from stickslip.plot.style import COLUMN as COLUMN
from stickslip.plot.style import GREEN as GREEN
from stickslip.plot.style import GREY as GREY
from stickslip.plot.style import ORANGE as ORANGE
from stickslip.plot.style import PAGE as PAGE
from stickslip.plot.style import PALETTE as PALETTE
from stickslip.plot.style import SKY as SKY
from stickslip.plot.style import VERMILLION as VERMILLION
from stickslip.plot.style import dress as dress
from stickslip.plot.style import house_style as house_style
from stickslip.plot.style import label as label
from stickslip.plot.style import legend_above as legend_above
from stickslip.plot.style import letter as letter
from stickslip.plot.style import new_figure as new_figure
from stickslip.plot.style import save as save
from stickslip.plot.style import unit_text as unit_text


class _Plot(ModuleType):
    """A module that draws what it is called with: what a notebook tries first."""

    def __call__(self, what: object) -> Figure:
        """Draw a run, a measured trace or a sweep at a glance, or the picture of an answer."""
        if isinstance(what, xr.Dataset):
            return sweep_picture(what) if "regime" in what else overview(what)
        if isinstance(what, Answer) and hasattr(what, "plot"):
            figure: Figure = what.plot()
            return figure
        raise InputError(f"plot: of {type(what).__name__} there is no picture: give a run, trace, sweep or answer")


sys.modules[__name__].__class__ = _Plot
