"""Schedule, isolated worker, timing, journal: from a plan of trials to rows."""
