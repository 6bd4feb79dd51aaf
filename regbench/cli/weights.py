"""regbench weights: the weights that methods bring."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from regbench.cli.options import Json, help_without_verb

app = typer.Typer(
    help="Weights of learned methods.",
    callback=help_without_verb,
    invoke_without_command=True,
    rich_markup_mode=None,
)


@app.command("ls")
def ls(
    as_json: Json = False,
    plugin: Annotated[list[Path] | None, typer.Option("--plugin", help="Python file with a Trainable.")] = None,
) -> None:
    """List the weight files of learned methods; a damaged one, or a method that does not import, with its reason."""
    from regbench.errors import UserError
    from regbench.learning.weights_list import HEADER, weights_in, words
    from regbench.registry import TrainableRegistry

    registry = TrainableRegistry(plugin or [])
    entries, broken = [], {}
    for name in registry.names():
        try:
            folder = registry.find(name).recipes  # type: ignore[attr-defined]  # a Trainable, found by its methods
        except UserError as error:
            broken[name] = str(error)
            continue
        entries += weights_in(folder, name) if folder is not None else []
    if as_json:
        print(
            json.dumps(
                entries + [{"method": name, "ok": False, "reason": why} for name, why in broken.items()], indent=1
            )
        )
        return
    rows = [list(HEADER), *map(words, entries)]
    widths = [max(len(row[column]) for row in rows) for column in range(len(HEADER) - 1)]
    for row in rows if entries else []:
        print("  ".join([*(cell.ljust(width) for cell, width in zip(row, widths, strict=False)), row[-1]]))
    for name, why in broken.items():
        print(f"{name}: not ready: {why}")
    if not entries and not broken:
        print("no weights: no method here brings any")


@app.command("record")
def record(
    runs: Annotated[list[Path], typer.Argument(help="Run folders.")],
    plugin: Annotated[list[Path] | None, typer.Option("--plugin", help="Python file with a method.")] = None,
) -> None:
    """Write the figures of runs into the model cards of the weights that they used, as "test"."""
    from regbench.learning.weight_files import SUFFIX
    from regbench.learning.weights import add_test_figures, card_path
    from regbench.registry import MethodRegistry
    from regbench.report.weight_figures import figures_by_file
    from regbench.runner.rundir import find_run

    found, left_out = figures_by_file([find_run(run) for run in runs], MethodRegistry(plugin or []))
    for path, figures in found.items():
        if path.suffix != SUFFIX or not card_path(path).is_file():
            left_out.append(f"{path}: no weight file with a model card")
            continue
        written, fewer = add_test_figures(path, figures)
        left_out += fewer
        for what in written:
            print(f"{card_path(path)}: {what}")
    for line in left_out:
        print(f"left out: {line}")
    if not found and not left_out:
        print("no method of these runs has weights")


@app.command("import")
def import_(
    method: Annotated[str, typer.Argument(help="The method, e.g. pointnetlk.")],
    file: Annotated[Path, typer.Argument(help="An original implementation's checkpoint (torch.save).")],
    out: Annotated[Path | None, typer.Option(help="File to write (else FILE's name with .safetensors, here).")] = None,
    plugin: Annotated[list[Path] | None, typer.Option("--plugin", help="Python file with the method.")] = None,
) -> None:
    """Read an original checkpoint: names are mapped, shapes checked, and a card names the source."""
    from regbench.learning.checkpoint_import import import_checkpoint
    from regbench.registry import MethodRegistry, TrainableRegistry, parse_methods

    trainable = TrainableRegistry(plugin or []).find(method)
    found = MethodRegistry(plugin or []).resolve(parse_methods([method])[0])
    path = out or Path(file.with_suffix(".safetensors").name)
    import_checkpoint(
        file,
        path,
        method=method,
        renamed=trainable.renamed,  # type: ignore[attr-defined]  # a Trainable, found by its methods
        check=lambda weights: found.cls(weights=str(weights)).prepare(),
    )
    print(f'{path}: for --method "{method}[weights={path}]"')
