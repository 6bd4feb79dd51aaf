"""Recall over thresholds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from regbench.report.figures.axes import mark_evenly, shares
from regbench.report.figures.look import Look, looks
from regbench.report.figures.panel import PANEL_HEIGHT, Array, Material, Panel
from regbench.report.recall_curves import MAX_ROTATION_DEG, recall_curves
from regbench.report.trial_errors import DEG_PER_LENGTH, trial_errors

THRESHOLDS_DEG = np.linspace(0.0, MAX_ROTATION_DEG, 301)
# What has to be within the threshold, and the axis's words.
WITHIN = {
    "both": "rotation error at most (deg)",
    "rotation": "rotation error at most (deg), alone",
    "translation": "translation error at most (length), alone",
}
SECOND_AXIS = "and translation error at most (length)"
ROOM_FOR_SECOND_AXIS = 0.35


def recall_panels(material: Material) -> list[Panel]:
    """Return a panel for each protocol and each of `choice`, of WITHIN."""
    look = looks(material.methods)
    panels = []
    for label, groups in material.protocols.items():
        curves = {
            group.method.method: recall_curves(trial_errors(group, material.run), THRESHOLDS_DEG) for group in groups
        }
        for within in material.choice:
            panels.append(_panel(label, within, {name: found[within] for name, found in curves.items()}, look))
    return panels


def _panel(label: str, within: str, curves: Mapping[str, Array], look: Mapping[str, Look]) -> Panel:
    def draw(panel: Any) -> None:
        scale = DEG_PER_LENGTH if within == "translation" else 1.0
        for method, curve in curves.items():
            if np.isfinite(curve).all():  # else there was no trial
                panel.plot(THRESHOLDS_DEG / scale, curve, **look[method].line())
        mark_evenly(panel)
        panel.set(xlim=(0, MAX_ROTATION_DEG / scale), xlabel=WITHIN[within], ylabel="share of trials")
        shares(panel, "y")
        if within == "both":
            second = panel.secondary_xaxis("top", functions=(_lengths, _degrees))
            second.set_xlabel(SECOND_AXIS)

    return Panel(label, draw, PANEL_HEIGHT + ROOM_FOR_SECOND_AXIS * (within == "both"))


def _lengths(degrees: Any) -> Any:
    return degrees / DEG_PER_LENGTH


def _degrees(lengths: Any) -> Any:
    return lengths * DEG_PER_LENGTH
