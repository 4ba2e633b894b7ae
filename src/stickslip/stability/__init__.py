"""Linear stability of smooth sliding."""
