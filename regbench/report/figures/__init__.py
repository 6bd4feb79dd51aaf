"""Figures of runs for a printed page."""

# The figures, as `regbench plot` names them; kinds.py has how each is drawn. Here, since it loads nothing.
FIGURES = ("recall", "pareto", "ecdf", "time", "heatmap")
