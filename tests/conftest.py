"""Settings that every test shares."""

import os

from hypothesis import settings

# Before anything imports matplotlib, and inherited by the commands that tests start.
os.environ["MPLBACKEND"] = "Agg"

# Same examples on every machine and every run; compiling a kernel inside an example is not a failure.
settings.register_profile("stickslip", derandomize=True, deadline=None)
settings.load_profile("stickslip")
