"""Pure functions that score estimates, then the table of metrics."""
