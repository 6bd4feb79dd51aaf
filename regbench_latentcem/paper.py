"""All tables of the LatentCEM paper, and the times in its text, with ours beside them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from regbench.errors import UserError
from regbench.reproduction.tables import Part, run_part, write_table, write_times

from . import ablations

if TYPE_CHECKING:
    from regbench.learning.training.keeper import Progress

CLEAN, NOISE, SCENES = "modelnet40/clean@1", "modelnet40/noise@1", "7scenes/clean@1"

# Ours for each row of Table 1: our best, and the published setting where it is another one. Go-ICP's takes minutes a
# pair; what it shows is in docs/goicp.md.
ROWS: dict[str, tuple[str, ...]] = {
    "ICP": ("icp", "icp[preset=paper]"),
    "Go-ICP": ("goicp",),
    "Super4PCS": ("super4pcs",),
    "FGR": ("fgr", "fgr[preset=paper]"),
    "PointNetLK": ("pointnetlk",),
    "FMR": ("fmr",),
    "IDAM": ("idam",),
    "RPM-Net": ("rpmnet",),
}
# What a reader needs to tell what the benchmark can tell.
BESIDE = ("icp[init=prior]", "icp_restarts[starts=prior]", "degenerate", "prior_mean", "identity")
MODELNET40 = Part(
    "modelnet40",
    {"modelnet40_same": CLEAN, "modelnet40_noise": NOISE},
    {**ROWS, "LatentCEM": ("latentcem", "latentcem[refine=icp]"), "": BESIDE},
)
SEVEN_SCENES = Part(
    "7scenes",
    {"7scene": SCENES},
    {**ROWS, "LatentCEM": ("latentcem[weights=7scenes]", "latentcem[weights=7scenes,refine=icp]"), "": BESIDE},
)


def reproduce(
    out: Path,
    *,
    data: Path,
    steps: int,
    limit: int | None,
    weights: str | None,
    changes: Sequence[str],
    device: Literal["auto", "cpu", "cuda"],
    threads: int,
    jobs: int,
    progress: Progress,
    say: Callable[[str], None],
) -> int | None:
    """Run and write Table 1, the times, and Table 2 with its figures; what `out` holds already is not done again.

    Args:
        out: Folder: modelnet40/ and 7scenes/ (runs), table1 and times, ablations/ (see ablations.py).
        data: Folder of the prepared datasets.
        steps: Of each of Table 2's four trainings.
        limit: The first so many problems of each protocol; None: all of them, and for Table 2 and its figures 100.
        weights: As in ablations.py.
        changes: As in ablations.py.
        device: Of the trainings and their measurements; Table 1 is on the CPU, unless "cuda" is asked for.
        threads: CPU threads.
        jobs: Trials of Table 1 at a time, each on cores of its own.
        progress: Shows how far a training is.
        say: Takes a line on each step.

    Returns:
        The signal that a training was stopped by, or None.

    Raises:
        UserError: Data or weights are missing, matplotlib or Lightning is not installed, or the folder holds
            something else.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"{out}: cannot be made ({error.strerror})") from error
    parts = (MODELNET40, SEVEN_SCENES)
    on = "cuda" if device == "cuda" else "cpu"
    folders = [
        run_part(part, out, data=data, limit=limit, threads=threads, jobs=jobs, device=on, say=say) for part in parts
    ]
    taken = "all problems" if limit is None else f"the first {limit} problems of each protocol (the paper's rows: all)"
    words = (
        f"Table 1 of the paper, ours under each of its rows, {taken}. Translations in lengths of the unit sphere. "
        "A cell with ! cannot hold: over n pairs RMSE / MAE is sqrt(3 n) at most."
    )
    write_table("table1", words, parts, folders, out)
    words = (
        f"The times in the paper's text, ours under each, {CLEAN}, {taken}. One pair a call, {on}, CPU threads: "
        f"{threads}; the machine is in {MODELNET40.name}/manifest.json."
    )
    write_times("times", words, MODELNET40, CLEAN, folders[0], out)
    say(f"wrote {out / 'table1.md'} and {out / 'times.md'}; now Table 2 and the figures")
    return ablations.reproduce(
        out / "ablations",
        data=data,
        steps=steps,
        limit=limit,
        weights=weights,
        changes=changes,
        device=device,
        threads=threads,
        jobs=1,
        progress=progress,
        say=say,
    )
