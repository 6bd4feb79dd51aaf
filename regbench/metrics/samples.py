"""What a row of a table is computed from: one value per trial of a method on a protocol."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from regbench.metrics.rotation import euler_residuals_deg, rotation_error_deg
from regbench.metrics.translation import translation_error, translation_residuals

Array = NDArray[np.float64]


def _none() -> Array:
    return np.empty(0)


@dataclass(frozen=True, eq=False, kw_only=True)
class Samples:
    """Errors and times of one method on one protocol, each over its own trials.

    Attributes:
        rotation_residuals_deg: (n, 3) predicted minus true Euler angles.
        translation_residuals: (n, 3) predicted minus true, in the clouds' unit.
        rotation_errors_deg: (n,) isotropic.
        translation_errors: (n,) isotropic, in the clouds' unit.
        time_ms: (k,) wall times of the trials that answered.
        cpu_ms: (k',) CPU times of the trials that answered.
        symmetry_aware_errors: (n,), empty where not computed.
        modified_chamfers: (n,), empty where not computed.
    """

    rotation_residuals_deg: Array
    translation_residuals: Array
    rotation_errors_deg: Array
    translation_errors: Array
    time_ms: Array = field(default_factory=_none)
    cpu_ms: Array = field(default_factory=_none)
    symmetry_aware_errors: Array = field(default_factory=_none)
    modified_chamfers: Array = field(default_factory=_none)

    @classmethod
    def of_motions(cls, T_estimates: ArrayLike, T_truth: ArrayLike, **others: Array) -> Samples:
        """Return the samples of (n, 4, 4) estimates of T_target_source against (n, 4, 4) ground truths.

        Raises:
            ValueError: The shapes are not (n, 4, 4) both, or a value is not finite.
        """
        estimates, truth = np.asarray(T_estimates, dtype=np.float64), np.asarray(T_truth, dtype=np.float64)
        if estimates.ndim != 3 or estimates.shape[1:] != (4, 4) or truth.shape != estimates.shape:
            raise ValueError(f"expected (n, 4, 4) estimates and truths, got {estimates.shape} and {truth.shape}")
        if not (np.isfinite(estimates).all() and np.isfinite(truth).all()):
            raise ValueError("a motion has values that are not finite; score a failed trial as the identity")
        return cls(
            rotation_residuals_deg=euler_residuals_deg(estimates[:, :3, :3], truth[:, :3, :3]),
            translation_residuals=translation_residuals(estimates, truth),
            rotation_errors_deg=rotation_error_deg(estimates[:, :3, :3], truth[:, :3, :3]),
            translation_errors=translation_error(estimates, truth),
            **others,
        )
