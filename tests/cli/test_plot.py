"""regbench plot, as a command."""

import subprocess
import sys
from pathlib import Path

import pytest
from PIL import Image

from regbench.cli.main import main
from tests.report.helpers import example_run

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
        (["planning"], "plot planning: give the method to draw with --method"),
        (["planning", "run", "-m", METHOD], "goes with a figure of runs, not with a picture of a problem"),
        (["planning", "-m", METHOD, "--width", "page"], "--width goes with a figure of runs"),
        (["planning", "-m", METHOD, "-p", "demo@1", "-p", "demo@2"], "one problem of one protocol, not of 2"),
        (["recal"], "unknown plot 'recal'; did you mean 'recall'?"),
        (["recall"], "no run"),
        (["recall", "gone"], "gone"),
        (["recall", "--problem", "3"], "--problem goes with a picture of a problem, not with a figure of runs"),
        (["ecdf", "--within", "rotation"], "--within goes with `plot recall`"),
        (["recall", "--by", "category"], "--by goes with `plot heatmap`"),
        (["recall", "--width", "broad"], "--width"),
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
    assert "Names: recall, pareto, ecdf, time, heatmap, planning." in answer.stdout
    assert answer.stdout.endswith("set()\n")


@pytest.mark.parametrize(
    ("more", "out"),
    [
        (["recall"], "recall.pdf"),
        (["recall", "--within", "rotation,translation", "--width", "page", "-o", "a.svg"], "a.svg"),
        (["pareto", "--metric", "rre_median_deg,mae_t", "-p", "demo@1", "-o", "a.png"], "a.png"),
        (["ecdf", "-m", "icp", "-m", "failing", "--metric", "cpu_median_ms"], "ecdf.pdf"),
        (["time"], "time.pdf"),
        (["heatmap", "--by", "protocol", "--metric", "rmse_r_deg"], "heatmap.pdf"),
    ],
)
def test_figures_of_a_run(here, capsys, more, out):
    example_run(here / "run")
    assert main(["plot", more[0], "run", *more[1:]]) == 0
    assert capsys.readouterr().out == f"wrote {out}\n"
    assert (here / out).stat().st_size > 1000
    assert sorted(path.name for path in here.iterdir()) == sorted(["run", out])


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["recall", "run", "-o", "a.jpg"], "--out a.jpg: a figure is saved as PDF, SVG or PNG"),
        (["recall", "run", "-o", "gone/a.pdf"], "gone/a.pdf: cannot be written"),
        (["recall", "run", "-m", "icpp"], "unknown method 'icpp' of these runs; did you mean 'icp'?"),
        (["heatmap", "run", "--by", "category"], "demo@1 has no categories, or one alone"),
        (["pareto", "run", "--metric", "time_median_ms"], "it is drawn of metrics of accuracy"),
    ],
)
def test_figures_that_cannot_be_drawn_leave_nothing(here, capsys, more, words):
    example_run(here / "run")
    assert main(["plot", *more]) == 2
    said = capsys.readouterr().err
    assert said.startswith("regbench: ")
    assert said.count("\n") == 1
    assert words in said
    assert [path.name for path in here.iterdir()] == ["run"]


def test_matplotlib_is_named_with_the_extra_that_brings_it(here, capsys, monkeypatch):
    example_run(here / "run")
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    assert main(["plot", "recall", "run"]) == 2
    words = 'regbench: drawing needs matplotlib, which is not installed: pip install "regbench[plots]"\n'
    assert capsys.readouterr().err == words
