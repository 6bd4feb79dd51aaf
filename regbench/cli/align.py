"""regbench align: two files of one's own."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

import typer

from regbench.cli.options import Json, Methods, Plugins


def align(
    source: Annotated[Path, typer.Argument(help="Cloud to move (.ply .pcd .off .npy .xyz).")],
    target: Annotated[Path, typer.Argument(help="Cloud to move it onto.")],
    method: Methods,
    save: Annotated[Path | None, typer.Option(help="Write the moved source here (.ply .npy .xyz).")] = None,
    picture: Annotated[Path | None, typer.Option(help="Write a PNG of before and after.")] = None,
    plugin: Plugins = None,
    timeout: Annotated[float, typer.Option(help="Seconds that a method may take.")] = 60.0,
    memory: Annotated[float, typer.Option(help="GB that a method may use.")] = 8.0,
    threads: Annotated[int, typer.Option(help="Threads a method may use.")] = 1,
    seed: Annotated[int, typer.Option(help="Seed of the methods' random choices.")] = 0,
    as_json: Json = False,
) -> None:
    """Align one cloud to another with one or more methods, and print each transform.

    The methods are compared by the mean distance from a moved source point to the nearest target point; the best
    answer is the one that is saved and drawn.
    """
    from regbench.cli.progress import say
    from regbench.runner.align import align_files

    answers = align_files(
        source,
        target,
        methods=method,
        plugins=plugin or [],
        timeout=timeout,
        memory=memory,
        threads=threads,
        seed=seed,
        save=save,
        picture=picture,
        note=say,
    )
    if as_json:
        print(json.dumps(answers, indent=1))
    for answer in [] if as_json else answers:
        if answer["status"] != "ok":
            print(f"{answer['method']}: {answer['status']}: {answer['error']}")
            continue
        mark = " (best)" if answer["best"] else ""
        distance, time_ms = answer["mean_distance"], answer["time_ms"]
        print(f"{answer['method']}: mean distance {distance:.6g}, {time_ms:.1f} ms{mark}")
        for row in answer["T_target_source"]:
            print("  " + " ".join(f"{value: .9f}" for value in row))
    for path in (save, picture):
        if path is not None and any(answer["best"] for answer in answers):
            print(f"wrote {path}", file=sys.stderr)
    if not any(answer["status"] == "ok" for answer in answers):
        raise typer.Exit(1)
