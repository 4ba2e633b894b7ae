"""Rate-and-state friction from contacts: whether an interface follows it, fits of
measured steps, and files for other programs.

Geophysicists describe friction by a direct effect ``a``, an evolution effect ``b`` and
a distance ``D``. Contacts with activation and ageing approximate it, others do not;
`rate_and_state` reports whether an interface does, and where the parameters are wrong.
"""

from stickslip.rate_state.contacts import finite_step, small_step
from stickslip.rate_state.equivalent_law import RateAndStateFit, rate_and_state
from stickslip.rate_state.experiments import Healing, Step, healing, velocity_step_in
from stickslip.rate_state.exports import export_rate_and_state
from stickslip.rate_state.laws import RateAndState
from stickslip.rate_state.measured import (
    ContactsFit,
    StepFit,
    fit_contacts,
    fit_rate_and_state,
)
from stickslip.rate_state.record import Hold, RecordFit, fit_record

__all__ = [
    "ContactsFit",
    "Healing",
    "Hold",
    "RateAndState",
    "RateAndStateFit",
    "RecordFit",
    "Step",
    "StepFit",
    "export_rate_and_state",
    "finite_step",
    "fit_contacts",
    "fit_rate_and_state",
    "fit_record",
    "healing",
    "rate_and_state",
    "small_step",
    "velocity_step_in",
]
