"""regbench reproduce latentcem-ablations: all of it, small, on a store of made-up shapes."""

import csv
import os
import re
import shutil
import signal
import sys
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image

from regbench.cli.main import main
from regbench.datasets.dataset import Split
from regbench.datasets.store_writer import write_dataset
from regbench.learning.training import keeper
from regbench.learning.weights import save_weights
from regbench.testing.clouds import body
from regbench_latentcem import ablations, measurement
from regbench_latentcem.model import Configuration, LatentModel
from regbench_latentcem.training import LatentCemTraining

PAIRS = [("dgcnn", "folding"), ("dgcnn", "mlp"), ("folding", "folding"), ("folding", "mlp")]
TINY = """training.batch=1 training.warm_up_steps=0 method.points=64 method.held_out=2
    method.validated=1 method.decoded=1 method.copies=2""".split()


def split_of(name, count):
    shapes = np.stack([body(784, seed=seed) for seed in range(count)]).astype(np.float32)
    return Split(shapes, np.zeros(count, dtype=np.int64), [f"chair/{name}/{i}" for i in range(count)])


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    """Prepared data with the name of ModelNet40, and random weights."""
    folder = tmp_path_factory.mktemp("store")
    write_dataset(
        folder,
        "modelnet40",
        description="made by a test",
        label_names=["chair"],
        splits={"train": split_of("train", 4), "test": split_of("test", 3)},
        options={},
        left_out={},
        remarks={},
    )
    torch.manual_seed(0)
    configuration = Configuration()
    tensors = LatentModel(configuration).without_decoder().state_dict()
    save_weights(folder / "random.safetensors", tensors, {"configuration": configuration.as_card()})
    return folder


@contextmanager
def made_small(folder):
    """A small grid, with `folder` as the current one; the number of torch's threads is put back."""
    before = torch.get_num_threads()
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setattr(ablations, "ITERATIONS", (1, 2))
        patch.setattr(ablations, "CANDIDATES", (30, 40))
        # The pictures of the trainings themselves would take most of the time.
        patch.setattr(keeper, "plot_training", lambda rows, path: None)
        yield folder
    torch.set_num_threads(before)


@pytest.fixture
def small(tmp_path):
    """A small grid, in an empty current folder."""
    with made_small(tmp_path):
        yield tmp_path


def arguments(store, *more, limit=2):
    fixed = ["--data", str(store), "--weights", str(store / "random.safetensors"), "--device", "cpu", "--steps", "2"]
    changes = [word for change in TINY for word in ("--set", change)]
    return ["reproduce", "latentcem-ablations", *fixed, "--limit", str(limit), *changes, "--out", "out", *more]


@pytest.fixture(scope="module")
def finished(store, tmp_path_factory):
    """The folder of a finished reproduction."""
    with made_small(tmp_path_factory.mktemp("finished")) as folder:
        assert main(arguments(store)) == 0
    return folder / "out"


def rows_of(path):
    return list(csv.DictReader(path.read_text().splitlines()))


def test_table2_has_three_rows_for_each_pair_of_networks(finished):
    rows = rows_of(finished / "table2.csv")
    assert [(row["encoder"], row["decoder"]) for row in rows] == [pair for pair in PAIRS for _ in range(3)]
    assert [row["row"] for row in rows] == ["none", "icp", "paper"] * 4
    for row in rows:
        assert row["n"] == ("" if row["row"] == "paper" else "2")
        assert float(row["rmse_r_deg"]) > 0
    for encoder, decoder in PAIRS:
        recipe = (finished / "trainings" / f"{encoder}-{decoder}" / "recipe.toml").read_text()
        assert f'encoder = "{encoder}"\ndecoder = "{decoder}"' in recipe
        assert "\nsteps = 2\n" in recipe
    text = (finished / "table2.md").read_text()
    assert "four trainings of 2 steps each, the first 2 problems of modelnet40/clean@1" in text
    assert "| dgcnn | folding | paper |  |  | 3.02 | 0.28 | 0.0028 | 0.0004 |" in text


def test_the_papers_rows_are_as_printed(finished):
    """Table 2 of the paper, in its order: rows of encoder, decoder and RMSE(R)."""
    printed = {
        ("folding", "mlp"): 4.35,
        ("folding", "folding"): 3.58,
        ("dgcnn", "mlp"): 3.33,
        ("dgcnn", "folding"): 3.02,
    }
    found = {(row["encoder"], row["decoder"]): row["rmse_r_deg"] for row in ablations.paper_rows()}
    assert found == printed


def test_the_paper_is_asked_for_its_own_grid():
    assert ablations.ITERATIONS == (4, 6, 8, 10, 12, 14, 16)
    assert ablations.CANDIDATES == (50, 125, 250, 500, 1000)


def test_heatmap_and_times_are_over_the_grid(finished):
    grid = rows_of(finished / "heatmap.csv")
    assert [(row["T"], row["N"]) for row in grid] == [("1", "30"), ("1", "40"), ("2", "30"), ("2", "40")]
    times = rows_of(finished / "time.csv")
    assert [row["T"] for row in times] == ["1", "2"]
    assert [row["time_ms"] for row in times] == [row["time_ms"] for row in grid if row["N"] == "40"]


@pytest.mark.parametrize("name", ["table2", "heatmap", "time"])
def test_figures_are_drawn(finished, name):
    with Image.open(finished / f"{name}.png") as image:
        assert image.format == "PNG"
        assert np.asarray(image.convert("L")).std() > 10, "it is not empty"


def test_what_is_finished_is_not_done_again(store, small, finished, monkeypatch, capsys):
    shutil.copytree(finished, "out")

    def never(*arguments):
        raise AssertionError("done again")

    monkeypatch.setattr(measurement, "measure", never)
    monkeypatch.setattr(LatentCemTraining, "losses", never)
    assert main(arguments(store)) == 0
    said = capsys.readouterr()
    assert said.out == "wrote out\n"
    assert said.err == ""
    for name in ("table2.csv", "heatmap.csv", "time.csv", "table2.md", "table2.png"):
        assert Path("out", name).read_bytes() == (finished / name).read_bytes()


def test_more_problems_need_measurements_alone(store, small, finished, monkeypatch):
    shutil.copytree(finished, "out")
    monkeypatch.setattr(LatentCemTraining, "losses", None)
    assert main(arguments(store, limit=9)) == 0
    assert {row["n"] for row in rows_of(Path("out/heatmap.csv"))} == {"3"}, "the protocol has three problems here"


def test_ctrl_c_in_a_training_stops_and_the_same_command_continues(store, small, finished, monkeypatch, capsys):
    losses, calls = LatentCemTraining.losses, []

    def interrupted(self, *given):
        calls.append(self)
        if len(calls) == 3:  # the first step of the second training
            os.kill(os.getpid(), signal.SIGINT)
        return losses(self, *given)

    monkeypatch.setattr(LatentCemTraining, "losses", interrupted)
    assert main(arguments(store)) == 130
    assert "give the same command again to continue" in capsys.readouterr().err
    assert sorted(path.name for path in Path("out").iterdir()) == ["trainings"]
    assert len(calls) == 3
    assert main(arguments(store)) == 0
    assert len(calls) == 8, "four trainings of two steps, none twice"

    def errors(path):
        return [{key: value for key, value in row.items() if not key.endswith("_ms")} for row in rows_of(path)]

    assert errors(Path("out/table2.csv")) == errors(finished / "table2.csv")


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--weights", "gone.safetensors"], "weights gone.safetensors: no such file"),
        (["--weights", "gone"], "no weights 'gone'"),
        (["--data", "gone"], "modelnet40 is not prepared in gone"),
        (["--set", "method.widht=5"], "unknown key 'widht'"),
        (["--set", "widht=5"], "--set widht=5: write training.KEY=VALUE or method.KEY=VALUE"),
        (["--limit", "0"], "limit"),
    ],
)
def test_bad_input_is_one_line_before_anything_is_done(store, small, capsys, more, words):
    assert main(arguments(store, *more)) == 2
    said = capsys.readouterr().err
    assert re.fullmatch(r"regbench: [^\n]*\n", said)
    assert words in said
    assert list(small.iterdir()) == []


def test_other_trainings_in_the_folder_are_left_alone(store, small, finished, capsys):
    shutil.copytree(finished, "out")
    assert main(arguments(store, "--steps", "3")) == 2
    assert "dgcnn-folding: holds a training with training.steps = 2, this one has 3" in capsys.readouterr().err


def test_matplotlib_is_missed_before_the_trainings(store, small, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    assert main(arguments(store)) == 2
    assert "drawing needs matplotlib, which is not installed" in capsys.readouterr().err
    assert list(small.iterdir()) == []


def test_an_unknown_experiment_gets_a_did_you_mean(capsys):
    assert main(["reproduce", "latentcem-ablation"]) == 2
    assert "unknown experiment 'latentcem-ablation'; did you mean 'latentcem-ablations'?" in capsys.readouterr().err
