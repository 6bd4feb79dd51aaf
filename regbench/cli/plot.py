"""regbench plot: a picture of a method at work on one problem."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from regbench.cli.options import Data, Plugins


def plot(
    name: Annotated[str, typer.Argument(help="The picture, one of the names below.")],
    method: Annotated[str, typer.Option("--method", "-m", help="One method, e.g. latentcem[model=equivariant].")],
    protocol: Annotated[str, typer.Option(help="Where the problem is from.")] = "demo@1",
    problem: Annotated[int, typer.Option(min=0, help="Its number.")] = 0,
    out: Annotated[Path | None, typer.Option(help="PNG file to write (else NAME.png).")] = None,
    data: Data = None,
    plugin: Plugins = None,
) -> None:
    """Draw a method at work on one problem of a protocol; the truth is shown in the picture, not to the method."""
    from regbench import registry
    from regbench.datasets.store import data_dir
    from regbench.errors import UserError

    out = out or Path(f"{name}.png")
    if out.suffix.lower() != ".png":
        raise UserError(f"--out {out}: a picture is saved as PNG; let its name end in .png")
    draw = registry.load(registry.PLOTS, name, what="plot", listing="`regbench plot --help`")
    specs = registry.parse_methods([method])
    if len(specs) > 1:
        raise UserError(f"--method {method}: asks for {len(specs)} methods; a picture is of one")
    found = registry.MethodRegistry(plugin or []).resolve(specs[0])
    if missing := found.missing():
        raise UserError(f"method '{found.asked}' needs {', '.join(missing)}, which is not installed")
    problems = registry.find_protocol(protocol).open(data_dir(data))
    if problem >= len(problems):
        raise UserError(f"--problem {problem}: {protocol} has the problems 0 to {len(problems) - 1}")
    shown, pair = problems.problem(problem, protocol=protocol)
    registrar = found.cls(**found.parameters)
    if reason := registrar.skip(shown) if hasattr(registrar, "skip") else None:
        raise UserError(f"method '{found.asked}' skips problem {problem} of {protocol}: {reason}")
    draw(registrar, shown, pair.T_target_source, out)
    print(f"wrote {out}")
