"""The table of metrics: each says what it is called, its unit, whether higher is better, and its formula's source."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from operator import attrgetter
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from regbench.errors import UserError
from regbench.metrics.recall import THRESHOLDS, within
from regbench.metrics.reduction import Reduction, reduce
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
        per_trial: From samples to one value a trial, (n,); empty where there is nothing to compute them from.
        reduction: From those to the figure.
    """

    key: str
    name: str
    unit: str
    higher_is_better: bool
    decimals: int
    source: str
    needs: Literal["motions", "times", "clouds"]
    per_trial: Callable[[Samples], Array]
    reduction: Reduction

    def figure(self, samples: Samples) -> float:
        """Return the figure of a row; NaN where there is nothing to compute it from."""
        return reduce(self.per_trial(samples), self.reduction)


def _squares(name: str) -> Callable[[Samples], Array]:
    return lambda samples: np.mean(getattr(samples, name) ** 2, axis=1)


def _sizes(name: str) -> Callable[[Samples], Array]:
    return lambda samples: np.mean(np.abs(getattr(samples, name)), axis=1)


def _recall(name: str) -> Metric:
    degrees, length = THRESHOLDS[name]
    words = f"share of trials within {degrees:g} deg and {length:g}"

    def hits(samples: Samples) -> Array:
        return within(samples.rotation_errors_deg, samples.translation_errors, degrees, length).astype(np.float64)

    return Metric(f"recall_{name}", f"recall {degrees:g}°", f"and {length:g}", True, 4, words, "motions", hits, "mean")


_DCP_R = "DCP (Wang and Solomon 2019): Euler angles zyx, pairs and axes together"
_DCP_T = "DCP (Wang and Solomon 2019): translation, pairs and axes together"
_ISO_R = "RPM-Net (Yew and Lee 2020): angle of R_truth^-1 R"
_ISO_T = "RPM-Net (Yew and Lee 2020): norm of the translation of T_truth^-1 T"
_WALL, _CPU = "wall time of the trials that answered", "CPU time of the trials that answered"
_ADD_S = "ADD-S (Xiang et al. 2018), mean over trials"
_CHAMFER = "RPM-Net (Yew and Lee 2020): squared distances against the clean clouds, mean over trials"
_EULER, _SHIFT = "rotation_residuals_deg", "translation_residuals"
_RRE, _RTE = attrgetter("rotation_errors_deg"), attrgetter("translation_errors")
_TIME, _CPU_TIME = attrgetter("time_ms"), attrgetter("cpu_ms")

_ALL = (
    Metric("rmse_r_deg", "RMSE(R)", "deg", False, 4, _DCP_R, "motions", _squares(_EULER), "root mean"),
    Metric("rmse_t", "RMSE(t)", "length", False, 4, _DCP_T, "motions", _squares(_SHIFT), "root mean"),
    Metric("mae_r_deg", "MAE(R)", "deg", False, 4, _DCP_R, "motions", _sizes(_EULER), "mean"),
    Metric("mae_t", "MAE(t)", "length", False, 5, _DCP_T, "motions", _sizes(_SHIFT), "mean"),
    Metric("rre_mean_deg", "RRE mean", "deg", False, 4, _ISO_R, "motions", _RRE, "mean"),
    Metric("rre_median_deg", "RRE median", "deg", False, 4, _ISO_R, "motions", _RRE, "median"),
    Metric("rte_mean", "RTE mean", "length", False, 5, _ISO_T, "motions", _RTE, "mean"),
    Metric("rte_median", "RTE median", "length", False, 5, _ISO_T, "motions", _RTE, "median"),
    *(_recall(name) for name in THRESHOLDS),
    Metric("time_median_ms", "time", "ms median", False, 3, _WALL, "times", _TIME, "median"),
    Metric("time_p95_ms", "time p95", "ms", False, 3, _WALL, "times", _TIME, "p95"),
    Metric("cpu_median_ms", "CPU time", "ms median", False, 3, _CPU, "times", _CPU_TIME, "median"),
    Metric("rre_p75_deg", "RRE p75", "deg", False, 4, _ISO_R, "motions", _RRE, "p75"),
    Metric("rre_p95_deg", "RRE p95", "deg", False, 4, _ISO_R, "motions", _RRE, "p95"),
    Metric("rte_p75", "RTE p75", "length", False, 5, _ISO_T, "motions", _RTE, "p75"),
    Metric("rte_p95", "RTE p95", "length", False, 5, _ISO_T, "motions", _RTE, "p95"),
    Metric(
        "symmetry_aware_error",
        "sym. error",
        "length",
        False,
        5,
        _ADD_S,
        "clouds",
        attrgetter("symmetry_aware_errors"),
        "mean",
    ),
    Metric(
        "modified_chamfer",
        "mod. Chamfer",
        "length²",
        False,
        6,
        _CHAMFER,
        "clouds",
        attrgetter("modified_chamfers"),
        "mean",
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
    return {metric.key: metric.figure(samples) for metric in METRICS.values() if metric.needs == "motions"}
