"""Rate and state out of contacts: the verdict of an interface, fits of measured steps, and files for other programs.

Geophysicists describe friction by a direct effect ``a``, an evolution effect ``b`` and a distance ``D``. Contacts with
temperature and ageing come near to it, others do not; `rate_and_state` says which, and what the parameters get wrong.
"""

from stickslip.rate_state.contacts import finite_step as finite_step
from stickslip.rate_state.contacts import small_step as small_step
from stickslip.rate_state.experiments import Healing as Healing
from stickslip.rate_state.experiments import Step as Step
from stickslip.rate_state.experiments import healing as healing
from stickslip.rate_state.experiments import velocity_step_in as velocity_step_in
from stickslip.rate_state.exports import export_rate_and_state as export_rate_and_state
from stickslip.rate_state.laws import RateAndState as RateAndState
from stickslip.rate_state.measured import ContactsFit as ContactsFit
from stickslip.rate_state.measured import StepFit as StepFit
from stickslip.rate_state.measured import fit_contacts as fit_contacts
from stickslip.rate_state.measured import fit_rate_and_state as fit_rate_and_state
from stickslip.rate_state.verdict import RateAndStateFit as RateAndStateFit
from stickslip.rate_state.verdict import rate_and_state as rate_and_state
