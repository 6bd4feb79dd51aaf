"""Recall over thresholds, as the page and the figures draw it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from regbench.report.curves import shares_within
from regbench.report.trial_errors import DEG_PER_LENGTH, TrialErrors

Array = NDArray[np.float64]

# Recall is drawn up to the widest of the tables' thresholds.
MAX_ROTATION_DEG = 15.0


def recall_curves(errors: TrialErrors, thresholds_deg: Array) -> dict[str, Array]:
    """Return the share of trials within each of (k,) thresholds, by what has to be within.

    Args:
        errors: The trials.
        thresholds_deg: (k,) of the rotation; the translation's are these over DEG_PER_LENGTH.

    Returns:
        (k,) shares by "both" (what the tables call recall), "rotation" and "translation"; NaN where there is no trial.
    """
    return {
        "both": shares_within(errors.misses_deg, thresholds_deg),
        "rotation": shares_within(errors.rotation_errors_deg, thresholds_deg),
        "translation": shares_within(errors.translation_errors, thresholds_deg / DEG_PER_LENGTH),
    }
