"""``python -m stickslip``: the command line."""

import sys

from stickslip.cli import main

sys.exit(main())
