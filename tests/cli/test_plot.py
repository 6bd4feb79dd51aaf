"""regbench plot, as a command."""

import subprocess
import sys
from pathlib import Path

import pytest
from PIL import Image

from regbench.cli.main import main

METHOD = "latentcem[model=equivariant,T=2,N=40,K=5]"


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty current folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_picture_of_a_search(here, capsys):
    assert main(["plot", "planning", "--method", METHOD, "--problem", "3"]) == 0
    assert capsys.readouterr().out == "wrote planning.png\n"
    with Image.open("planning.png") as image:
        assert image.format == "PNG"
    assert main(["plot", "planning", "--method", METHOD, "--problem", "3", "--out", "again.png"]) == 0
    assert Path("again.png").read_bytes() == Path("planning.png").read_bytes()
    assert main(["plot", "planning", "--method", METHOD, "--out", "other.png"]) == 0
    assert Path("other.png").read_bytes() != Path("planning.png").read_bytes()


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["planing", "-m", METHOD], "unknown plot 'planing'; did you mean 'planning'?"),
        (["planning", "-m", "latentcen"], "did you mean 'latentcem'?"),
        (["planning", "-m", "identity"], "'identity' has no planner"),
        (["planning", "-m", "latentcem[T=2,3]"], "asks for 2 methods"),
        (["planning", "-m", METHOD, "--problem", "100000"], "--problem 100000: demo@1 has the problems 0 to "),
        (["planning", "-m", METHOD, "--problem", "-1"], "--problem"),
        (["planning", "-m", METHOD, "--protocol", "demo@9"], "unknown protocol 'demo@9'"),
        (["planning", "-m", METHOD, "--out", "a.pdf"], "--out a.pdf: a picture is saved as PNG"),
        (["planning", "-m", METHOD, "--out", "gone/a.png"], "gone/a.png: cannot be written"),
        (["planning", "-m", "prior_mean", "--protocol", "7scenes/frames@1", "--data", "gone"], "not prepared"),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(here, capsys, more, words):
    assert main(["plot", *more]) == 2
    said = capsys.readouterr().err
    assert said.startswith("regbench: ")
    assert said.count("\n") == 1
    assert words in said
    assert list(here.iterdir()) == []


def test_help_names_the_plots_and_loads_nothing_heavy():
    code = "import sys; from regbench.cli.main import main; main(['plot', '--help']); "
    code += "print(sys.modules.keys() & {'torch', 'numpy', 'matplotlib', 'regbench_latentcem'})"
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert "Names: planning." in answer.stdout
    assert answer.stdout.endswith("set()\n")
