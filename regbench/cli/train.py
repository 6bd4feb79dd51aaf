"""regbench train: a learned method's weights, by a recipe."""

from __future__ import annotations

import signal
import sys
from pathlib import Path
from typing import Annotated, Literal

import typer

from regbench.cli.options import Data

Device = Literal["auto", "cpu", "cuda"]


def train(
    name: Annotated[str, typer.Argument(help="The method, e.g. latentcem.")],
    recipe: Annotated[str | None, typer.Option(help="A recipe of the method, or a file ending in .toml.")] = None,
    steps: Annotated[int | None, typer.Option(help="Short for --set training.steps=N.")] = None,
    batch: Annotated[int | None, typer.Option(help="Short for --set training.batch=N.")] = None,
    seed: Annotated[int | None, typer.Option(help="Short for --set training.seed=N.")] = None,
    changes: Annotated[
        list[str] | None, typer.Option("--set", help="training.KEY=VALUE or method.KEY=VALUE over the recipe's.")
    ] = None,
    start: Annotated[Path | None, typer.Option("--from", help="Weights (.safetensors) to begin with.")] = None,
    device: Annotated[Device, typer.Option(help="auto: CUDA where there is one.")] = "auto",
    devices: Annotated[int, typer.Option(min=1, help="How many; they share each batch.")] = 1,
    threads: Annotated[int | None, typer.Option(min=1, help="CPU threads (else torch's own number).")] = None,
    data: Data = None,
    out: Annotated[Path | None, typer.Option(help="Folder of the training (else one under runs/).")] = None,
    plugin: Annotated[list[Path] | None, typer.Option("--plugin", help="Python file with a Trainable.")] = None,
) -> int:
    """Train a learned method. The same command continues after Ctrl-C or kill; docs/training.md has the rest."""
    from regbench.cli.progress import say
    from regbench.cli.training_progress import training_display
    from regbench.datasets.store import data_dir
    from regbench.learning.training import engine
    from regbench.learning.training.folder import default_folder
    from regbench.learning.training.recipe import load_recipe, parse_change
    from regbench.learning.training.recipe_files import find_recipe
    from regbench.registry import TrainableRegistry

    trainable = TrainableRegistry(plugin or []).find(name)
    short = {"steps": steps, "batch": batch, "seed": seed}
    over = [(f"training.{key}", value) for key, value in short.items() if value is not None]
    path = find_recipe(trainable, name, recipe)
    resolved = load_recipe(path, name, [*map(parse_change, changes or []), *over])
    folder = out or default_folder(name, path.stem, resolved, start)
    with training_display(sys.stderr) as progress:
        outcome = engine.train(
            trainable,
            resolved,
            folder,
            data=data_dir(data),
            device=device,
            devices=devices,
            threads=threads,
            start=start,
            progress=progress,
        )
    if not outcome.is_main:
        return 0
    if outcome.steps < outcome.total:
        say(f"{folder}: saved at step {outcome.steps} of {outcome.total}")
        return 128 + (outcome.signal or signal.SIGTERM)  # None: it came to another of the processes
    print(f"{folder}: {outcome.steps} steps done; {outcome.best_words()}")
    return 0 if outcome.best is not None else 1
