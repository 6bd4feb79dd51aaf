"""The paper's own figures as rows beside ours, with the cells that cannot hold marked.

paper_table1.csv and paper_runtime.csv are Table 1 and the running times of LatentCEM (IJCAI 2021), as printed.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from decimal import Decimal
from importlib.resources import files
from typing import Any

from regbench.metrics.rotation import rmse_to_mae_bound
from regbench.metrics.table import METRICS

# Pairs that the paper tests on, by column group of its Table 1.
PAIRS = {"modelnet40_same": 2468, "modelnet40_noise": 2468, "7scene": 57}
# The running times are means over the ModelNet40 test set.
TIMED = ("modelnet40_same",)
RATIOS = (("rmse_r_deg", "mae_r_deg"), ("rmse_t", "mae_t"))


def published_rows(column_group: str, protocol: str) -> list[dict[str, Any]]:
    """Return the paper's rows of one column group, shaped as `summarise` shapes ours.

    Args:
        column_group: One of PAIRS.
        protocol: Name of the protocol beside which the rows stand.

    Returns:
        Rows whose kind is "published" and whose failures are None (the paper does not say). `impossible` lists the
        keys of cells that cannot hold; `printed` has the cells digit for digit; `time_note` says what was timed.
    """
    times = {row["method"]: row for row in _read("paper_runtime.csv")} if column_group in TIMED else {}
    n = PAIRS[column_group]
    rows = []
    for cells in _read("paper_table1.csv"):
        if cells["dataset"] != column_group:
            continue
        figures: dict[str, float | None] = {key: None for key, metric in METRICS.items() if metric.needs != "clouds"}
        figures |= {key: float(cells[key]) for ratio in RATIOS for key in ratio}
        impossible = _impossible(cells, n)
        time = times.get(cells["method"])
        if time is not None:
            figures["time_median_ms"] = float(time["ms_per_pair"])
        rows.append(
            {
                "method": f"{cells['method']} (paper)",
                "protocol": protocol,
                "n": n,
                "failures": None,
                **figures,
                "kind": "published",
                "sees_ground_truth": False,
                "planned": n,
                "n_truth": n,
                "note": _note(cells["note"], impossible, n),
                "impossible": sorted(impossible),
                "printed": {key: cells[key] for ratio in RATIOS for key in ratio},
                "time_note": f"mean, {time['device']}" if time is not None else None,
            }
        )
    return rows


def published_times() -> list[dict[str, str]]:
    """Return the running times that the paper's text gives, as printed: method, ms_per_pair, device."""
    return _read("paper_runtime.csv")


def _impossible(cells: Mapping[str, str], n: int) -> dict[str, float]:
    """Return the ratio RMSE / MAE by key, for the pairs of cells whose ratio no residuals of n pairs can have.

    Rounding is given its due: the RMSE may be half a last digit smaller, the MAE half a last digit greater.
    """
    found: dict[str, float] = {}
    for rmse_key, mae_key in RATIOS:
        least_rmse = float(cells[rmse_key]) - _half_digit(cells[rmse_key])
        greatest_mae = float(cells[mae_key]) + _half_digit(cells[mae_key])
        if least_rmse > greatest_mae * rmse_to_mae_bound(n):
            ratio = float(cells[rmse_key]) / float(cells[mae_key])
            found |= {rmse_key: ratio, mae_key: ratio}
    return found


def _half_digit(printed: str) -> float:
    exponent = Decimal(printed).as_tuple().exponent
    assert isinstance(exponent, int)
    return 0.5 * 10.0**exponent


def _note(given: str, impossible: Mapping[str, float], n: int) -> str | None:
    """Return why cells are marked: the computed reason where there is one, else the remark beside the figures."""
    reasons = [
        f"{METRICS[rmse_key].name} / {METRICS[mae_key].name} = {impossible[rmse_key]:.0f}"
        for rmse_key, mae_key in RATIOS
        if rmse_key in impossible
    ]
    if reasons:
        bound = rmse_to_mae_bound(n)
        return f"cannot hold: {' and '.join(reasons)}, over {n} pairs at most sqrt(3 * {n}) = {bound:.1f}"
    return given or None


def _read(name: str) -> list[dict[str, str]]:
    return list(csv.DictReader((files("regbench.report") / name).read_text(encoding="utf-8").splitlines()))
