"""regbench train and regbench weights, as commands."""

import json
import os
import signal
import subprocess
import sys
import time
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest
import torch

from regbench import registry
from regbench.cli.main import main
from regbench.learning.weights import save_weights
from tests.learning.training.toy_training import TRAINING, Toy, toy_recipe

TOY = Path(__file__).parent.parent / "learning" / "training" / "toy_training.py"


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A folder with a recipe of the toy; the number of torch's threads is put back."""
    monkeypatch.chdir(tmp_path)
    Path("toy.toml").write_text(toy_recipe(steps=6, validate_every=6).as_toml())
    before = torch.get_num_threads()
    yield tmp_path
    torch.set_num_threads(before)


def arguments(*more):
    return ["train", "toy", "--plugin", str(TOY), "--recipe", "toy.toml", "--device", "cpu", "--threads", "1", *more]


def test_train_says_what_is_best_and_where(here, capsys):
    assert main(arguments("--out", "run")) == 0
    said = capsys.readouterr()
    assert said.out.startswith("run: 6 steps done; best at step 6: error ")
    assert said.out.endswith("run/toy.safetensors\n")
    assert "training run: 6 steps\nstep 6 of 6: loss.total " in said.err
    assert main(arguments("--out", "run")) == 0
    assert capsys.readouterr().out == said.out, "the same command has nothing left to do, and says the same"


def test_options_go_over_the_recipe(here, capsys):
    given = ["--steps", "4", "--batch", "3", "--seed", "7", "--set", "training.average=0", "--set", "method.width=5"]
    assert main(arguments("--out", "run", *given)) == 0
    card = json.loads(Path("run/toy.json").read_text())
    training = card["recipe"]["training"]
    assert [training[key] for key in ("steps", "batch", "seed", "average")] == [4, 3, 7, 0]
    assert card["recipe"]["method"] == {"width": 5}
    assert training["learning_rate"] == TRAINING["learning_rate"]


def test_the_resolved_recipe_makes_the_same_weights(here, capsys):
    assert main(arguments("--out", "one", "--seed", "3")) == 0
    Path("toy.toml").write_text(Path("one/recipe.toml").read_text())
    assert main(arguments("--out", "two")) == 0
    assert Path("one/toy.safetensors").read_bytes() == Path("two/toy.safetensors").read_bytes()


def test_without_out_the_same_command_finds_its_own_folder(here, capsys):
    assert main(arguments()) == 0
    assert main(arguments()) == 0
    assert main(arguments("--seed", "1")) == 0
    assert len(list(Path("runs").glob("train-toy-toy-*"))) == 2


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--set", "method.widht=5"], "toy: [method] unknown key 'widht'; did you mean 'width'?"),
        (["--set", "training.batsh=5"], "[training] unknown key 'batsh'; did you mean 'batch'?"),
        (["--set", "batch=5"], "--set batch=5: write training.KEY=VALUE or method.KEY=VALUE"),
        (["--steps", "0"], "[training] steps = 0"),
        (["--recipe", "gone.toml"], "gone.toml"),
        (["--recipe", "gone"], "unknown recipe 'gone' of method 'toy'"),
        (["--from", "gone.safetensors"], "cannot read gone.safetensors"),
        (["--device", "tpu"], "tpu"),
        (["--devices", "0"], "devices"),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(here, capsys, more, words):
    assert main(arguments(*more)) == 2
    said = capsys.readouterr().err
    assert said.startswith("regbench: ")
    assert said.count("\n") == 1
    assert words in said
    assert [path.name for path in here.iterdir()] == ["toy.toml"]


def test_an_unknown_name_gets_a_did_you_mean(here, capsys):
    assert main(["train", "toi", "--plugin", str(TOY)]) == 2
    assert "unknown trainable method 'toi'; did you mean 'toy'?" in capsys.readouterr().err
    Path("empty.py").write_text("")
    assert main(["train", "toy", "--plugin", "empty.py"]) == 2
    assert "plugin empty.py: no Trainable with a `name`" in capsys.readouterr().err


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_a_stopped_process_continues_to_the_same_weights(here, number):
    recipe = toy_recipe(steps=40, log_every=2, checkpoint_every=2, loader_workers=1, method={"pace_s": 0.02})
    Path("toy.toml").write_text(recipe.as_toml())
    command = [sys.executable, "-m", "regbench", *arguments("--out", "run")]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, process_group=0)
    limit = time.monotonic() + 120
    while not (here / "run/checkpoints/last.ckpt").exists() and process.poll() is None:
        assert time.monotonic() < limit
        time.sleep(0.02)
    os.killpg(process.pid, number)  # as a terminal and a scheduler do: to the loader processes too
    _, error = process.communicate(timeout=60)
    if number == signal.SIGKILL:
        assert process.returncode == -signal.SIGKILL
    else:
        assert process.returncode == 128 + number, error
        saved, hint = error.splitlines()[-2:]
        done = torch.load("run/checkpoints/last.ckpt", weights_only=True)["global_step"]
        assert saved == f"run: saved at step {done} of 40"
        assert 2 <= done < 40
        assert hint == "regbench: interrupted; give the same command again to continue"
    assert main(arguments("--out", "run")) == 0
    assert main(arguments("--out", "whole")) == 0
    assert Path("run/toy.safetensors").read_bytes() == Path("whole/toy.safetensors").read_bytes()


@pytest.fixture
def installed(here, monkeypatch):
    """The toy as an installed method, with a folder of weights; and one that does not import."""
    folder = here / "weights"
    folder.mkdir()
    monkeypatch.setattr(Toy, "recipes", folder)
    points = {
        "toy": EntryPoint("toy", "tests.learning.training.toy_training:Toy", registry.TRAINABLES),
        "broken": EntryPoint("broken", "a_package_that_nobody_has:X", registry.TRAINABLES),
    }
    real = registry._entry_points
    monkeypatch.setattr(
        registry, "_entry_points", lambda group: points if group == registry.TRAINABLES else real(group)
    )
    return folder


def test_weights_of_installed_methods_are_listed(installed, capsys):
    assert main(["train", "toy", "--recipe", "toy.toml", "--out", "run", "--device", "cpu", "--threads", "1"]) == 0
    for suffix in ("safetensors", "json"):
        (installed / f"demo.{suffix}").write_bytes(Path(f"run/toy.{suffix}").read_bytes())
    save_weights(installed / "cut.safetensors", {"w": torch.zeros(3)}, {})
    (installed / "cut.safetensors").write_bytes(b"")
    capsys.readouterr()
    assert main(["weights", "ls"]) == 0
    header, cut, demo, broken = capsys.readouterr().out.splitlines()
    assert header.split() == ["name", "method", "parameters", "MB", "steps", "hours", "device", "validation", "sha256"]
    assert "damaged: weights " in cut
    assert "SHA-256 is not the one in cut.json" in cut
    assert demo.split()[:2] == ["demo", "toy"]
    assert demo.endswith("  ok")
    assert "error " in demo
    assert broken.startswith("broken: not ready: trainable method 'broken' cannot be loaded")
    assert main(["weights", "ls", "--json"]) == 0
    entries = {entry.get("name", entry["method"]): entry for entry in json.loads(capsys.readouterr().out)}
    assert (entries["demo"]["ok"], entries["cut"]["ok"], entries["broken"]["ok"]) == (True, False, False)
    assert entries["demo"]["steps"] == 6


def test_an_installed_method_finds_its_recipe_by_name(installed, here, capsys):
    (installed / "small.toml").write_text(Path("toy.toml").read_text())
    assert main(["train", "toy", "--device", "cpu", "--threads", "1", "--out", "run"]) == 0
    assert main(["train", "toy", "--recipe", "smal", "--out", "run"]) == 2
    assert "did you mean 'small'?" in capsys.readouterr().err
    assert main(["train", "broken"]) == 2
    assert "a_package_that_nobody_has" in capsys.readouterr().err


def test_help_loads_nothing_heavy():
    code = "import sys; from regbench.cli.main import main; main(['train', '--help']); "
    code += "print(sys.modules.keys() & {'torch', 'numpy', 'lightning', 'matplotlib'})"
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert answer.stdout.endswith("set()\n")
