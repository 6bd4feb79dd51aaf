"""Whether times can be quoted: a wall time far above the CPU time was taken on a core that something else used."""

from __future__ import annotations

import numpy as np

from regbench.report.trials import Trials

# Alone on its core, a median wall time is within 2 % of its CPU time (docs/timing.md); beside another run, twice it.
DISTURBED = 1.25
WORDS = (
    f"over {DISTURBED:g} times the CPU time: something else used its core, or it waits for a device; not to be quoted."
)


def is_disturbed(wall_median_ms: float | None, cpu_median_ms: float | None) -> bool:
    """Return whether a median wall time is too far above the CPU time. With several threads this cannot be seen."""
    return wall_median_ms is not None and cpu_median_ms is not None and wall_median_ms > DISTURBED * cpu_median_ms


def are_disturbed(trials: Trials) -> bool:
    """Return it of the trials that answered; False where none has a time."""
    timed = trials.answered & ~np.isnan(trials.time_ms) & ~np.isnan(trials.cpu_ms)
    if not timed.any():
        return False
    return is_disturbed(float(np.median(trials.time_ms[timed])), float(np.median(trials.cpu_ms[timed])))
