"""Pure functions on arrays and numbers; they import only numpy and numba."""
