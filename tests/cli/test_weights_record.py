"""`regbench weights record`: figures of runs in the model cards of the weights that they used."""

import json
import math

import pytest
import torch

from regbench.cli.main import main
from regbench.learning.weights import card_path, load_weights, save_weights

PLUGIN = """
from pathlib import Path

import numpy as np

from regbench import Registration


class Weighted:
    name = "weighted"

    def __init__(self, *, angle: float = 0.0) -> None:
        self.angle = angle

    def data_files(self):
        return [Path({weights!r}), Path({other!r})]

    def register(self, problem):
        return Registration(T_target_source=np.eye(4))
"""


@pytest.fixture
def made(tmp_path, monkeypatch):
    """Weights with a card, a data file without one, a plugin that uses both, and a run of it."""
    monkeypatch.chdir(tmp_path)
    weights, other, plugin = tmp_path / "w.safetensors", tmp_path / "table.txt", tmp_path / "weighted.py"
    save_weights(weights, {"w": torch.zeros(3)}, {"steps": 7})
    other.write_text("1")
    plugin.write_text(PLUGIN.format(weights=str(weights), other=str(other)))
    run(plugin, "weighted,weighted[angle=1],identity", "run")
    return weights, plugin


def run(plugin, methods, out, *more):
    assert main(["run", "--plugin", str(plugin), "-m", methods, "--limit", "4", "--out", out, *more]) == 0


def test_the_card_has_what_the_table_says(made, capsys):
    weights, plugin = made
    sha256 = load_weights(weights).card["sha256"]
    capsys.readouterr()
    assert main(["weights", "record", "run", "--plugin", str(plugin)]) == 0
    said = capsys.readouterr().out
    assert f"{card_path(weights)}: weighted on demo@1" in said
    assert "table.txt has no model card" in said
    card = load_weights(weights).card
    assert card["steps"] == 7
    assert card["sha256"] == sha256
    assert set(card["test"]) == {"weighted", "weighted[angle=1]"}, "identity has no weights"
    main(["table", "run", "--format", "json"])
    row = next(row for row in json.loads(capsys.readouterr().out) if row["method"] == "weighted")
    figures = card["test"]["weighted"][row["protocol"]]
    assert figures["n"] == 4
    assert figures["failures"] == {}
    assert "cores" in figures["machine"]
    assert "device cpu" in figures["machine"]
    for key in ("rre_median_deg", "rmse_r_deg", "mae_r_deg", "recall_5deg", "time_median_ms"):
        assert math.isclose(figures[key], row[key], rel_tol=1e-3), key


def test_other_figures_stay_and_the_same_are_replaced(made):
    weights, plugin = made
    main(["weights", "record", "run", "--plugin", str(plugin)])
    run(plugin, "weighted", "second", "--seed", "3")
    assert main(["weights", "record", "second", "--plugin", str(plugin)]) == 0
    test = json.loads(card_path(weights).read_text())["test"]
    assert "seed 3" in test["weighted"]["demo@1"]["machine"]
    assert "seed 0" in test["weighted[angle=1]"]["demo@1"]["machine"]


def test_figures_of_other_weights_are_left_out(made, capsys):
    weights, plugin = made
    save_weights(weights, {"w": torch.ones(3)}, {"steps": 8})
    capsys.readouterr()
    assert main(["weights", "record", "run", "--plugin", str(plugin)]) == 0
    assert "weighted on demo@1: the method or its weights have changed" in capsys.readouterr().out
    assert "test" not in load_weights(weights).card


def test_unfinished_rows_are_left_out(made, capsys):
    weights, plugin = made
    trials = (weights.parent / "run" / "trials.jsonl").read_text().splitlines(keepends=True)
    (weights.parent / "run" / "trials.jsonl").write_text("".join(line for line in trials if '"problem":3' not in line))
    capsys.readouterr()
    assert main(["weights", "record", "run", "--plugin", str(plugin)]) == 0
    assert "weighted on demo@1: 3 of 4 trials" in capsys.readouterr().out
    assert "test" not in load_weights(weights).card


def test_a_run_without_weights_and_a_folder_that_is_none(made, capsys):
    _, plugin = made
    run(plugin, "identity", "plain")
    capsys.readouterr()
    assert main(["weights", "record", "plain"]) == 0
    assert "no method of these runs has weights" in capsys.readouterr().out
    assert main(["weights", "record", "nothing"]) == 2
