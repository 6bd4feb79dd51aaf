"""regbench check: the conformance battery."""

from __future__ import annotations

from typing import Annotated

import typer

from regbench.cli.options import Plugins


def check(
    method: Annotated[str, typer.Argument(help="Method, e.g. icp or icp[preset=paper].")],
    plugin: Plugins = None,
) -> None:
    """Check that a method keeps the contract; exit code 1 if it does not."""
    from regbench.errors import UserError
    from regbench.registry import MethodRegistry, parse_methods
    from regbench.testing.check_registrar import check_registrar

    specs = parse_methods([method])
    if len(specs) != 1:
        raise UserError(f"check takes one method at a time, '{method}' is {len(specs)}")
    found = MethodRegistry(plugin or []).resolve(specs[0])
    results = check_registrar(found.cls, found.parameters)
    width = max(len(result.name) for result in results)
    for result in results:
        print(f"{result.outcome:7}  {result.name:{width}}  {result.detail}".rstrip())
    failed = sum(result.outcome == "failed" for result in results)
    print(f"{method}: {'conforms' if not failed else f'{failed} of {len(results)} checks failed'}")
    if failed:
        raise typer.Exit(1)
