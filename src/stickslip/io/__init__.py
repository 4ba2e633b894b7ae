"""Rig files, Datasets and their provenance: what goes to files and comes back."""
