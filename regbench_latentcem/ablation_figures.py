"""The figures of the ablation study. matplotlib is loaded when one is drawn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from regbench.drawing import new_figure

from .planning_picture import BLUE, GREY, ORANGE, save_figure

Rows = Sequence[Mapping[str, Any]]

# The table's rows, with a legend and a colour for each.
BARS = {"none": ("the planner alone", ORANGE), "icp": ("followed by ICP", BLUE), "paper": ("the paper's row", GREY)}
ERRORS = {"rmse_r_deg": "RMSE(R) (deg)", "mae_r_deg": "MAE(R) (deg)"}
HEATS = {"rmse_r_deg": "RMSE(R) (deg)", "rre_median_deg": "median rotation error (deg)"}
WIDTH = 0.27


def draw_table2(rows: Rows, path: Path) -> None:
    """Draw Table 2: bars for each encoder and decoder, of "encoder", "decoder", "row" and the errors in `rows`."""
    figure = new_figure()
    figure.set_size_inches(10, 3.6)
    pairs = list(dict.fromkeys((row["encoder"], row["decoder"]) for row in rows))
    for panel, (key, title) in zip(figure.subplots(1, len(ERRORS)), ERRORS.items(), strict=True):
        for offset, (kind, (label, colour)) in enumerate(BARS.items(), start=-1):
            errors = {(row["encoder"], row["decoder"]): row[key] for row in rows if row["row"] == kind}
            bars = panel.bar(np.arange(len(pairs)) + offset * WIDTH, [errors[p] for p in pairs], WIDTH, color=colour)
            bars.set_label(label)
            panel.bar_label(bars, fmt="%.3g", fontsize=7)
        panel.set_xticks(range(len(pairs)), [f"{encoder}\n{decoder}" for encoder, decoder in pairs], fontsize=8)
        panel.set_xlabel("encoder, decoder", fontsize=8)
        panel.set_yscale("log")
        panel.margins(y=0.12)
        panel.set_title(title, fontsize=9)
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), fontsize=8, frameon=False)
    save_figure(figure, path)


def draw_heatmap(rows: Rows, path: Path) -> None:
    """Draw the errors over "T" (across) and "N" (up), with the figure in each cell."""
    figure = new_figure()
    figure.set_size_inches(11, 3.6)
    T, N = (sorted({row[key] for row in rows}) for key in ("T", "N"))
    for panel, (key, title) in zip(figure.subplots(1, len(HEATS)), HEATS.items(), strict=True):
        errors = np.full((len(N), len(T)), np.nan)
        for row in rows:
            errors[N.index(row["N"]), T.index(row["T"])] = row[key]
        image = panel.imshow(errors, origin="lower", aspect="auto", cmap="viridis")
        middle = (np.nanmin(errors) + np.nanmax(errors)) / 2
        for (up, across), error in np.ndenumerate(errors):
            # White on the dark half of the map, black on the light one.
            colour = "white" if error < middle else "black"
            panel.text(across, up, f"{error:.3g}", ha="center", va="center", fontsize=8, color=colour)
        panel.set_xticks(range(len(T)), T)
        panel.set_yticks(range(len(N)), N)
        panel.set_xlabel("T (iterations)", fontsize=8)
        panel.set_ylabel("N (candidates)", fontsize=8)
        panel.set_title(title, fontsize=9)
        figure.colorbar(image, ax=panel)
    save_figure(figure, path)


def draw_time(rows: Rows, path: Path) -> None:
    """Draw "time_ms" of the whole call and "plan_ms" of the planner over "T"."""
    figure = new_figure()
    figure.set_size_inches(5, 3.4)
    panel = figure.subplots()
    T = [row["T"] for row in rows]
    for key, label, colour in (("time_ms", "the whole call", BLUE), ("plan_ms", "the planner", ORANGE)):
        panel.plot(T, [row[key] for row in rows], "o-", color=colour, label=label)
    panel.set_ylim(bottom=0)
    panel.set_xlabel("T (iterations)", fontsize=8)
    panel.set_ylabel("median time of a call (ms)", fontsize=8)
    panel.grid(alpha=0.3)
    panel.legend(fontsize=8, frameon=False)
    save_figure(figure, path)
