"""Rate and state beside the contacts."""
from stickslip.rate_state.laws import RateAndState
