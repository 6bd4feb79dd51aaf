"""The table of metrics: each says what it is called, its unit, whether higher is better, and its formula's source."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from regbench.errors import UserError
from regbench.metrics.recall import THRESHOLDS, recall
from regbench.metrics.rotation import mae, rmse
from regbench.metrics.samples import Samples
from regbench.suggest import unknown

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Metric:
    """One figure of a row.

    Attributes:
        key: Its name in JSON, CSV and on the command line.
        name: As printed.
        unit: As printed; "length" is the clouds' unit. A recall, a share, has its length threshold here.
        higher_is_better: What a table marks as best.
        decimals: Digits after the point in printed tables.
        source: Where the formula comes from.
        needs: Over which trials: "motions" and "clouds" take every trial of known truth, a failed one as the
            identity; "times" takes the trials that answered.
        function: From samples to the figure; NaN where there is nothing to compute it from.
    """

    key: str
    name: str
    unit: str
    higher_is_better: bool
    decimals: int
    source: str
    needs: Literal["motions", "times", "clouds"]
    function: Callable[[Samples], float]


def _of(name: str, statistic: Callable[[Array], Any]) -> Callable[[Samples], float]:
    """Return a function that takes one field of the samples and reduces it; NaN where the field is empty."""

    def function(samples: Samples) -> float:
        values: Array = getattr(samples, name)
        return float(statistic(values)) if values.size else float("nan")

    return function


def _p95(values: Array) -> float:
    return float(np.percentile(values, 95))


def _recall(name: str) -> Metric:
    degrees, length = THRESHOLDS[name]
    words = f"share of trials within {degrees:g} deg and {length:g}"

    def function(samples: Samples) -> float:
        return recall(samples.rotation_errors_deg, samples.translation_errors, degrees, length)

    return Metric(f"recall_{name}", f"recall {degrees:g}°", f"and {length:g}", True, 4, words, "motions", function)


_DCP_R = "DCP (Wang and Solomon 2019): Euler angles zyx, pairs and axes together"
_DCP_T = "DCP (Wang and Solomon 2019): translation, pairs and axes together"
_ISO_R = "RPM-Net (Yew and Lee 2020): angle of R_truth^-1 R"
_ISO_T = "RPM-Net (Yew and Lee 2020): norm of the translation of T_truth^-1 T"
_WALL, _CPU = "wall time of the trials that answered", "CPU time of the trials that answered"
_ADD_S = "ADD-S (Xiang et al. 2018), mean over trials"
_CHAMFER = "RPM-Net (Yew and Lee 2020): squared distances against the clean clouds, mean over trials"
_EULER, _SHIFT, _RRE, _RTE = (
    "rotation_residuals_deg",
    "translation_residuals",
    "rotation_errors_deg",
    "translation_errors",
)

_ALL = (
    Metric("rmse_r_deg", "RMSE(R)", "deg", False, 4, _DCP_R, "motions", _of(_EULER, rmse)),
    Metric("rmse_t", "RMSE(t)", "length", False, 4, _DCP_T, "motions", _of(_SHIFT, rmse)),
    Metric("mae_r_deg", "MAE(R)", "deg", False, 4, _DCP_R, "motions", _of(_EULER, mae)),
    Metric("mae_t", "MAE(t)", "length", False, 5, _DCP_T, "motions", _of(_SHIFT, mae)),
    Metric("rre_mean_deg", "RRE mean", "deg", False, 4, _ISO_R, "motions", _of(_RRE, np.mean)),
    Metric("rre_median_deg", "RRE median", "deg", False, 4, _ISO_R, "motions", _of(_RRE, np.median)),
    Metric("rte_mean", "RTE mean", "length", False, 5, _ISO_T, "motions", _of(_RTE, np.mean)),
    Metric("rte_median", "RTE median", "length", False, 5, _ISO_T, "motions", _of(_RTE, np.median)),
    *(_recall(name) for name in THRESHOLDS),
    Metric("time_median_ms", "time", "ms median", False, 3, _WALL, "times", _of("time_ms", np.median)),
    Metric("time_p95_ms", "time p95", "ms", False, 3, _WALL, "times", _of("time_ms", _p95)),
    Metric("cpu_median_ms", "CPU time", "ms median", False, 3, _CPU, "times", _of("cpu_ms", np.median)),
    Metric(
        "symmetry_aware_error",
        "sym. error",
        "length",
        False,
        5,
        _ADD_S,
        "clouds",
        _of("symmetry_aware_errors", np.mean),
    ),
    Metric(
        "modified_chamfer", "mod. Chamfer", "length²", False, 6, _CHAMFER, "clouds", _of("modified_chamfers", np.mean)
    ),
)

METRICS: dict[str, Metric] = {metric.key: metric for metric in _ALL}


def find_metrics(keys: Iterable[str]) -> list[Metric]:
    """Return metrics by key, in the order given.

    Raises:
        UserError: A key is unknown.
    """
    metrics = []
    for key in keys:
        if key not in METRICS:
            raise UserError(unknown("metric", key, METRICS, listing="`regbench ls metrics`"))
        metrics.append(METRICS[key])
    return metrics


def score(T_estimates: ArrayLike, T_truth: ArrayLike) -> dict[str, float]:
    """Return every accuracy metric of (n, 4, 4) estimates of T_target_source against (n, 4, 4) ground truths.

    A failed trial is to be given as the identity.

    Returns:
        Figures by metric key, without the times and those that need the clouds; NaN for n = 0.

    Raises:
        ValueError: The shapes are not (n, 4, 4) both, or a value is not finite.
    """
    samples = Samples.of_motions(T_estimates, T_truth)
    return {metric.key: metric.function(samples) for metric in METRICS.values() if metric.needs == "motions"}
