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
    weights, other, plugin = tmp_path / "w.safetensors", tmp_path / "table.json", tmp_path / "weighted.py"
    save_weights(weights, {"w": torch.zeros(3)}, {"steps": 7})
    other.write_text("1")
    plugin.write_text(PLUGIN.format(weights=str(weights), other=str(other)))
    run(plugin, "weighted,weighted[angle=1],identity", "run")
    return weights, plugin


def run(plugin, methods, out, *more, limit="4"):
    assert main(["run", "--plugin", str(plugin), "-m", methods, "--limit", limit, "--out", out, *more]) == 0


def test_the_card_has_what_the_table_says(made, capsys):
    weights, plugin = made
    sha256 = load_weights(weights).card["sha256"]
    capsys.readouterr()
    assert main(["weights", "record", "run", "--plugin", str(plugin)]) == 0
    said = capsys.readouterr().out
    assert f"{card_path(weights)}: weighted on demo@1" in said
    assert "table.json: no weight file with a model card" in said
    assert (weights.parent / "table.json").read_text() == "1"
    card = load_weights(weights).card
    assert card["steps"] == 7
    assert card["sha256"] == sha256
    assert set(card["test"]) == {"weighted", "weighted[angle=1]"}, "identity has no weights"
    main(["table", "run", "--format", "json"])
    row = next(row for row in json.loads(capsys.readouterr().out) if row["method"] == "weighted")
    figures = card["test"]["weighted"][row["protocol"]]["cpu"]
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
    assert "seed 3" in test["weighted"]["demo@1"]["cpu"]["machine"]
    assert "seed 0" in test["weighted[angle=1]"]["demo@1"]["cpu"]["machine"]


def test_each_device_has_its_own_figures_and_fewer_trials_do_not_replace_more(made, capsys):
    weights, plugin = made
    main(["weights", "record", "run", "--plugin", str(plugin)])
    manifest = weights.parent / "run" / "manifest.json"
    manifest.write_text(manifest.read_text().replace('"device": "cpu"', '"device": "cuda"'))
    main(["weights", "record", "run", "--plugin", str(plugin)])
    run(plugin, "weighted", "short", limit="2")
    capsys.readouterr()
    assert main(["weights", "record", "short", "--plugin", str(plugin)]) == 0
    assert "the card has figures of 4 trials, these are of 2" in capsys.readouterr().out
    figures = json.loads(card_path(weights).read_text())["test"]["weighted"]["demo@1"]
    assert {device: figures[device]["n"] for device in figures} == {"cpu": 4, "cuda": 4}


def test_runs_of_different_machines_may_be_recorded_at_once(made):
    weights, plugin = made
    run(plugin, "weighted", "other", "--seed", "3")
    assert main(["weights", "record", "run", "other", "--plugin", str(plugin)]) == 0
    machine = json.loads(card_path(weights).read_text())["test"]["weighted"]["demo@1"]["cpu"]["machine"]
    assert machine.count("cores") == 1
    assert "seed 3" in machine


@pytest.mark.parametrize("damaged", ["x", [1], {"weighted": 3}, {"weighted": {"demo@1": [2]}}])
def test_a_card_whose_test_is_no_table_is_refused_in_one_line(made, capsys, damaged):
    weights, plugin = made
    card = json.loads(card_path(weights).read_text())
    card_path(weights).write_text(json.dumps({**card, "test": damaged}))
    capsys.readouterr()
    assert main(["weights", "record", "run", "--plugin", str(plugin)]) == 2
    assert "its 'test' is no table" in capsys.readouterr().err


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
