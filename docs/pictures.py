"""Makes the pictures of README and docs: python docs/pictures.py."""

from pathlib import Path

from PIL import Image

from regbench.registry import MethodRegistry, find_protocol, parse_methods
from regbench.report.picture import save_before_after

PROTOCOL, PROBLEM, METHOD = "demo@1", 5, "fgr"


def main():
    """Write docs/pair.png: one problem of demo@1, before and after one method."""
    problem, _ = find_protocol(PROTOCOL).open(Path("data")).problem(PROBLEM, protocol=PROTOCOL)
    found = MethodRegistry().resolve(parse_methods([METHOD])[0])
    answer = found.cls(**found.parameters).register(problem)
    path = Path(__file__).with_name("pair.png")
    save_before_after(path, problem.source, problem.target, answer.T_target_source)
    Image.open(path).quantize(64).save(path, optimize=True)  # a third of the size, and nobody sees it


if __name__ == "__main__":
    main()
