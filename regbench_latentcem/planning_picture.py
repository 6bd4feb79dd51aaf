"""The picture of a search: candidates and elites over the iterations, and where the clouds come to lie."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from regbench.contract import Problem, Registrar
from regbench.drawing import new_figure
from regbench.errors import UserError
from regbench.files import write_atomically
from regbench.geometry.se3 import invert, rotation_from_euler_deg, transform

from .registrar import LatentCem

if TYPE_CHECKING:
    from .planner import Plan

Array = NDArray[np.float64]

# The first iterations change most; start and end of the search are always drawn.
ITERATIONS = (1, 2, 3, 5)
# Angles about x over y, and about x over z.
PLANES = ((0, 1), (0, 2))
AXES = ("x", "y", "z")
# Okabe and Ito's palette, as in regbench's pictures of clouds: source and elites orange, target blue.
ORANGE, BLUE, GREY = "#E68200", "#0068B2", "#B8B8B8"
PANEL_INCHES = 2.1
# What is drawn of the first iteration: so many standard deviations to each side.
SIGMAS = 2.5
# Clouds are seen obliquely from above.
VIEW = rotation_from_euler_deg([25.0, -35.0, 0.0])


def plot_planning(method: Registrar, problem: Problem, T_target_source: Array | None, out: Path) -> None:
    """Draw the planner's search on one problem, as `planning_figure`.

    Args:
        method: A LatentCem.
        problem: What it searches.
        T_target_source: (4, 4) truth, for the cross in the picture alone; or None.
        out: PNG file to write.

    Raises:
        UserError: The method is another one or has no iteration, its weights are missing, matplotlib is not
            installed, or the file cannot be written.
    """
    if not isinstance(method, LatentCem):
        raise UserError(f"plot planning: '{method.name}' has no planner; give --method latentcem or latentcem[...]")
    if method.T < 1:
        raise UserError("plot planning: there is no search to draw with T=0; give T=1 or more")
    save_figure(planning_figure(method, problem, T_target_source), out)


def planning_figure(method: LatentCem, problem: Problem, T_target_source: Array | None) -> Any:
    """Return the picture of a search.

    A column for the start and for each drawn iteration: candidates (grey), elites (orange) and their mean (black) in
    two planes of angles; below, the source moved by that mean (orange) over the target (blue). All in the local
    frame: clouds centred, lengths in extents of the target. Of several planners (refine=verify) it shows the first.
    """
    from .actions import motion_of

    figure = new_figure()
    frame, turn, found = method.search(problem)
    source = transform(turn, frame.source)
    truth = None
    if T_target_source is not None:
        truth = frame.to_local(np.asarray(T_target_source, dtype=np.float64)) @ invert(turn)
    shown = [0, *sorted({t for t in ITERATIONS if t < method.T} | {method.T})]
    figure.set_size_inches(PANEL_INCHES * len(shown), PANEL_INCHES * 3.3)
    panels = figure.subplots(len(PLANES) + 1, len(shown), squeeze=False, sharex="row", sharey="row")
    for column, t in enumerate(shown):
        mean = motion_of(found.means[t, 0].cpu().numpy())
        for panel, plane in zip(panels[:, column], PLANES, strict=False):
            _draw_plane(panel, found, t, plane, truth)
        _draw_clouds(panels[-1, column], transform(mean, source), frame.target)
        panels[0, column].set_title(_title(t, mean, truth), fontsize=9)
    for panel, (across, up) in zip(panels[:, 0], PLANES, strict=False):
        panel.set_xlabel(f"angle about {AXES[across]} (deg)", fontsize=8)
        panel.set_ylabel(f"angle about {AXES[up]} (deg)", fontsize=8)
    handles, labels = panels[0, -1].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), fontsize=8, frameon=False)
    return figure


def save_figure(figure: Any, path: Path) -> None:
    """Write a figure as PNG, whole or not at all.

    Raises:
        UserError: The file cannot be written.
    """
    image = io.BytesIO()
    figure.savefig(image, format="png", dpi=110)
    write_atomically(path, image.getvalue())


def _draw_plane(panel: Any, found: Plan, t: int, plane: Sequence[int], truth: Array | None) -> None:
    """Draw iteration t, of 1 to T; or where the search starts, 0."""
    from .actions import action_of

    def angles_deg(actions: Any) -> Array:
        angles: Array = np.degrees(np.asarray(actions, dtype=np.float64)[..., list(plane)])
        return angles

    assert found.candidates is not None
    if t > 0:
        kinds = ((found.candidates, GREY, 4, "candidates"), (found.elites, ORANGE, 7, "elites"))
        for actions, colour, size, label in kinds:
            points = angles_deg(actions[t - 1, 0].cpu())
            panel.scatter(*points.T, s=size, color=colour, linewidths=0, label=label)
    panel.plot(*angles_deg(found.means[t, 0].cpu()), "ko", ms=4, label="mean of the elites")
    if truth is not None:
        panel.plot(*angles_deg(action_of(truth)), "+", color=BLUE, ms=11, mew=1.8, label="true motion")
    # One range for all iterations, that of the first: so the narrowing is seen.
    centre, spread = angles_deg(found.means[0, 0].cpu()), SIGMAS * angles_deg(found.deviations[0, 0].cpu())
    panel.set_xlim(centre[0] - spread[0], centre[0] + spread[0])
    panel.set_ylim(centre[1] - spread[1], centre[1] + spread[1])
    panel.tick_params(labelsize=7)
    panel.grid(alpha=0.25)


def _draw_clouds(panel: Any, source: Array, target: Array) -> None:
    for cloud, colour in ((target, BLUE), (source, ORANGE)):
        across, up, _ = (cloud @ VIEW.T).T
        panel.scatter(across, up, s=1.5, color=colour, linewidths=0)
    panel.set_aspect("equal")
    panel.set_axis_off()


def _title(t: int, mean: Array, truth: Array | None) -> str:
    words = f"iteration {t}" if t else "start"
    if truth is None:
        return words
    from scipy.spatial.transform import Rotation

    off_deg = np.degrees(Rotation.from_matrix(truth[:3, :3].T @ mean[:3, :3]).magnitude())
    return f"{words}: {off_deg:.2g}° off"
