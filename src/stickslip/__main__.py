"""``python -m stickslip``: the command line."""

from stickslip.cli import main

main()
