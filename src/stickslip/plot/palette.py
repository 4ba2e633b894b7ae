"""Colours, dashes and widths of pictures."""

from typing import Any

BLACK = "#000000"
ORANGE = "#E69F00"
SKY = "#56B4E9"
GREEN = "#009E73"
BLUE = "#0072B2"
VERMILLION = "#D55E00"
PURPLE = "#CC79A7"
YELLOW = "#F0E442"
GREY = "#7F7F7F"
PALETTE = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY, BLACK)
"""Colours of Okabe and Ito, which colour-blind readers can distinguish; their yellow is
too pale for a line.
"""

DASHED = (0, (4, 2))  # dashes of a reference line
COMPARED: Any = {"color": GREY, "linewidth": 0.9, "linestyle": DASHED}
"""Style of a reference line."""

COLUMN = 3.5  # width of a printed column, in inches
PAGE = 7.0  # width of a printed page, in inches
