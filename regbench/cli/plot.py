"""regbench plot: figures of runs for a printed page, and pictures of a method at work on one problem."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from regbench.cli.options import Data, Plugins

OF_RUNS = ("runs", "metric", "width", "within", "by", "mixed")
OF_A_PROBLEM = ("problem", "plugin")


def plot(
    context: typer.Context,
    name: Annotated[str, typer.Argument(help="The figure or picture, one of the names below.")],
    runs: Annotated[
        list[Path] | None, typer.Argument(help="Of a figure: run folders; the latest run if none is named.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="File: .pdf, .svg or .png, else NAME.pdf; of a picture .png.")
    ] = None,
    width: Annotated[Literal["column", "page"], typer.Option(help="Of a figure: 3.3 or 7 inches.")] = "column",
    metric: Annotated[
        list[str] | None, typer.Option(help="Of a figure: metrics, see `regbench ls metrics`; may be repeated.")
    ] = None,
    within: Annotated[
        list[str] | None, typer.Option(help="Of recall: both errors (as in tables), rotation or translation alone.")
    ] = None,
    by: Annotated[
        Literal["category", "protocol"] | None, typer.Option(help="Of heatmap: what its cells are of.")
    ] = None,
    protocol: Annotated[
        list[str] | None,
        typer.Option("--protocol", "-p", help="Only these protocols; of a picture: the problem's (else demo@1)."),
    ] = None,
    method: Annotated[
        list[str] | None, typer.Option("--method", "-m", help="Only these methods; of a picture: the one at work.")
    ] = None,
    mixed: Annotated[bool, typer.Option(help="Of a figure: draw together what does not compare.")] = False,
    problem: Annotated[int, typer.Option(min=0, help="Of a picture: the problem's number.")] = 0,
    data: Data = None,
    plugin: Plugins = None,
) -> None:
    """Draw a figure of runs, as a printed page wants it; or a method at work on one problem of a protocol.

    Figures: recall over thresholds, accuracy against time (pareto), the distribution of errors (ecdf) and of times
    (time), recall or another metric by category or protocol (heatmap).
    """
    from regbench import registry
    from regbench.cli.options import refuse_given
    from regbench.errors import UserError
    from regbench.report.figures import FIGURES
    from regbench.suggest import unknown

    known = [*FIGURES, *registry.names(registry.PLOTS)]
    if name not in known:
        raise UserError(unknown("plot", name, known, listing="`regbench plot --help`"))
    if name not in FIGURES:
        refuse_given(context, OF_RUNS, "goes with a figure of runs, not with a picture of a problem")
        _picture(name, method, protocol, problem, out or Path(f"{name}.png"), data, plugin)
        return
    from regbench.registry import split_names
    from regbench.report.figures.draw import draw_figure
    from regbench.runner.rundir import find_run

    refuse_given(context, OF_A_PROBLEM, "goes with a picture of a problem, not with a figure of runs")
    for option, figure in (("within", "recall"), ("by", "heatmap")):
        if name != figure:
            refuse_given(context, (option,), f"goes with `plot {figure}`")
    out = out or Path(f"{name}.pdf")
    draw_figure(
        name,
        [find_run(path) for path in runs] if runs else [find_run(None)],
        out,
        width=width,
        choice=split_names(within) or ([by] if by else None),
        metrics=split_names(metric),
        protocols=split_names(protocol),
        methods=split_names(method),
        mixed=mixed,
        data_dir=data,
    )
    print(f"wrote {out}")


def _picture(
    name: str,
    method: list[str] | None,
    protocol: list[str] | None,
    problem: int,
    out: Path,
    data: Path | None,
    plugin: list[Path] | None,
) -> None:
    """Draw a method at work; the truth is shown in the picture, not to the method."""
    from regbench import registry
    from regbench.datasets.store import data_dir
    from regbench.errors import UserError

    if out.suffix.lower() != ".png":
        raise UserError(f"--out {out}: a picture is saved as PNG; let its name end in .png")
    draw = registry.load(registry.PLOTS, name, what="plot", listing="`regbench plot --help`")
    if not method:
        raise UserError(f"plot {name}: give the method to draw with --method")
    specs = registry.parse_methods(method)
    if len(specs) > 1:
        raise UserError(f"--method {','.join(method)}: asks for {len(specs)} methods; a picture is of one")
    protocols = protocol or ["demo@1"]
    if len(protocols) > 1:
        raise UserError(f"--protocol: a picture is of one problem of one protocol, not of {len(protocols)}")
    found = registry.MethodRegistry(plugin or []).resolve(specs[0])
    if missing := found.missing():
        raise UserError(f"method '{found.asked}' needs {', '.join(missing)}, which is not installed")
    problems = registry.find_protocol(protocols[0]).open(data_dir(data))
    if problem >= len(problems):
        raise UserError(f"--problem {problem}: {protocols[0]} has the problems 0 to {len(problems) - 1}")
    shown, pair = problems.problem(problem, protocol=protocols[0])
    registrar = found.cls(**found.parameters)
    if reason := registrar.skip(shown) if hasattr(registrar, "skip") else None:
        raise UserError(f"method '{found.asked}' skips problem {problem} of {protocols[0]}: {reason}")
    draw(registrar, shown, pair.T_target_source, out)
    print(f"wrote {out}")
