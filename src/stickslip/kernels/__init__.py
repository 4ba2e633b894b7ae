"""Pure functions on arrays and numbers: numpy and numba only, nothing else of ours."""
