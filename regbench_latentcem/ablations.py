"""The paper's ablation study: Table 2 (encoder x decoder), the heatmap over T and N, and time over T."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from regbench.drawing import new_figure
from regbench.errors import UserError
from regbench.files import write_atomically

from .ablation_figures import draw_heatmap, draw_table2, draw_time
from .measurement import Kept, Problems
from .registrar import LatentCem

if TYPE_CHECKING:
    from regbench.learning.training.keeper import Progress

Row = dict[str, Any]

PROTOCOL = "modelnet40/clean@1"
PROBLEMS = 100
ENCODERS, DECODERS = ("dgcnn", "folding"), ("folding", "mlp")
REFINEMENTS: tuple[Literal["none", "icp"], ...] = ("none", "icp")
# The paper's heatmap.
ITERATIONS = (4, 6, 8, 10, 12, 14, 16)
CANDIDATES = (50, 125, 250, 500, 1000)


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
    """Train, measure and draw; what `out` holds already is not done again.

    Args:
        out: Folder: trainings/, measurements/, and table2, heatmap and time as CSV, Markdown and PNG.
        data: Folder of the prepared datasets.
        steps: Of each of the four trainings.
        limit: The first so many problems of modelnet40/clean@1 are measured; None: 100.
        weights: For heatmap and time: a name in this package, a path that ends in .safetensors, or None: modelnet40.
        changes: Over the recipe modelnet40 of the trainings, as `regbench train --set` takes them.
        device: Of the trainings and the measurements.
        threads: CPU threads.
        jobs: 1; a training and its measurements are one after the other.
        progress: Shows how far a training is.
        say: Takes a line on each measurement.

    Returns:
        The signal that a training was stopped by, or None.

    Raises:
        UserError: Data or weights are missing, matplotlib or Lightning is not installed, the folder holds
            trainings of another recipe, or more than one job is asked for.
    """
    if jobs > 1:
        raise UserError(f"--jobs {jobs}: latentcem-ablations trains and measures one after the other")
    import torch

    from .weight_files import weight_files

    new_figure()  # says now, not after the trainings, that matplotlib is missing
    given = weight_files().path(weights or "modelnet40")
    LatentCem(weights=str(given)).prepare()
    torch.set_num_threads(threads)
    on = "cuda" if device != "cpu" and torch.cuda.is_available() else "cpu"
    problems = Problems.of(PROTOCOL, data, PROBLEMS if limit is None else limit, on)
    trained: dict[tuple[str, str], Path] = {}
    for encoder in ENCODERS:
        for decoder in DECODERS:
            folder = out / "trainings" / f"{encoder}-{decoder}"
            outcome = _train(folder, encoder, decoder, data, steps, changes, device, threads, progress)
            if outcome.signal is not None:
                return int(outcome.signal)
            if outcome.best is None:
                raise UserError(f"{folder}: {outcome.best_words()}")
            trained[encoder, decoder] = outcome.folder.weights

    kept = Kept(out / "measurements")

    def measured(name: str, file: Path, **parameters: Any) -> Row:
        method = LatentCem(weights=str(file), **parameters)
        figures, is_new = kept.measured(name, method, problems, file, {"device": on, "threads": threads})
        if is_new:
            say(f"{name}: RMSE(R) {figures['rmse_r_deg']:.4g} deg over {figures['n']:.0f} problems")
        return figures

    published = {(row["encoder"], row["decoder"]): row for row in paper_rows()}
    rows: list[Row] = []
    for (encoder, decoder), file in trained.items():
        for refine in REFINEMENTS:
            figures = measured(f"table2-{encoder}-{decoder}-{refine}", file, refine=refine)
            rows.append({"encoder": encoder, "decoder": decoder, "row": refine, **figures})
        rows.append({**published[encoder, decoder], "row": "paper"})
    _write_table(out / "table2", rows, _table2_words(steps, problems))
    draw_table2(rows, out / "table2.png")

    grid: list[Row] = [
        {"T": T, "N": N, **measured(f"heatmap-T{T}-N{N}", given, T=T, N=N)} for T in ITERATIONS for N in CANDIDATES
    ]
    words = f"The planner alone over T and N: {given.name}, the first {len(problems.pairs)} problems of {PROTOCOL}."
    _write_table(out / "heatmap", grid, words)
    draw_heatmap(grid, out / "heatmap.png")
    times = [{key: row[key] for key in ("T", "n", "plan_ms", "time_ms")} for row in grid if row["N"] == CANDIDATES[-1]]
    words = f"Median time of one call over T, N = {CANDIDATES[-1]}, on {on}, CPU threads: {threads}."
    _write_table(out / "time", times, words)
    draw_time(times, out / "time.png")
    return None


def paper_rows() -> list[Row]:
    """Return the paper's Table 2 as printed, with our names of encoders and decoders."""
    text = (files(__package__) / "paper_table2.csv").read_text(encoding="utf-8")
    names = ("encoder", "decoder")
    return [
        {key: value if key in names else float(value) for key, value in row.items()}
        for row in csv.DictReader(text.splitlines())
    ]


def _train(
    folder: Path,
    encoder: str,
    decoder: str,
    data: Path,
    steps: int,
    changes: Sequence[str],
    device: Literal["auto", "cpu", "cuda"],
    threads: int,
    progress: Progress,
) -> Any:
    """Train one pair of encoder and decoder, or go on with it; return the engine's Outcome."""
    from regbench.learning.training import engine
    from regbench.learning.training.recipe import load_recipe, parse_change

    from .training import LatentCemTraining
    from .weight_files import FOLDER

    over = {
        "training.steps": steps,
        "training.log_every": max(1, steps // 20),
        # Once, at the end: all four are measured after as many steps.
        "training.validate_every": steps,
        "method.start": "random",  # FoldingNet's encoder is no support function
        "method.encoder": encoder,
        "method.decoder": decoder,
    }
    recipe = load_recipe(FOLDER / "modelnet40.toml", "latentcem", [*over.items(), *map(parse_change, changes)])
    return engine.train(LatentCemTraining, recipe, folder, data=data, device=device, threads=threads, progress=progress)


def _table2_words(steps: int, problems: Problems) -> str:
    return (
        f"Table 2, encoder x decoder: four trainings of {steps} steps each, the first {len(problems.pairs)} problems "
        f"of {PROTOCOL}. Rows: none, the planner alone; icp, followed by ICP; paper, as printed (its trainings were "
        "longer, and it does not say what follows the planner)."
    )


def _write_table(path: Path, rows: Sequence[Mapping[str, Any]], words: str) -> None:
    """Write rows as PATH.csv, every digit, and as PATH.md, four digits, under some words."""
    heads = list(dict.fromkeys(key for row in rows for key in row))
    text = io.StringIO()
    writer = csv.DictWriter(text, heads, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    write_atomically(path.with_suffix(".csv"), text.getvalue().encode())
    cells = [[_cell(row.get(head)) for head in heads] for row in rows]
    lines = [f"| {' | '.join(line)} |" for line in [heads, ["---"] * len(heads), *cells]]
    write_atomically(path.with_suffix(".md"), "\n".join([words, "", *lines, ""]).encode())


def _cell(value: Any) -> str:
    if value is None:
        return ""
    return f"{value:.4g}" if isinstance(value, float) else str(value)
