"""Colours, dashes and widths of pictures."""

BLACK, ORANGE, SKY, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
BLUE, VERMILLION, PURPLE, YELLOW = "#0072B2", "#D55E00", "#CC79A7", "#F0E442"
GREY = "#7F7F7F"
PALETTE = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY, BLACK)
"""Colours of Okabe and Ito, which colour-blind readers can tell apart; yellow is too pale for a line."""

DASHED = (0, (4, 2))  # the dashes of a line that is compared with

COLUMN, PAGE = 3.5, 7.0
"""Widths of a printed column and page, in inches."""
