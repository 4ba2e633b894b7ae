"""Elastic sliders: fronts, precursors and the modes of smooth sliding."""
