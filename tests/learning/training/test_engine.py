"""Trainings of a toy, to the last bit."""

import csv
import json
import math
import signal
import subprocess
import sys
import warnings
from pathlib import Path

import pytest
import torch

from regbench.errors import UserError
from regbench.learning.training import engine, keeper
from regbench.learning.training.engine import train
from regbench.learning.training_words import training_words
from regbench.learning.weights import load_weights
from tests.learning.training.toy_training import Toy, toy_recipe


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch, request):
    """An empty current folder; pictures are drawn only where a test is about them."""
    monkeypatch.chdir(tmp_path)
    if "picture" not in request.node.name:
        monkeypatch.setattr(keeper, "plot_training", lambda rows, path: None)
    return tmp_path


def run(out, toy=Toy, recipe=None, **options):
    before = torch.get_num_threads()
    try:
        options = {"device": "cpu", "threads": 1, "data": Path("data")} | options
        return train(toy, recipe or toy_recipe(), Path(out), **options)
    finally:
        torch.set_num_threads(before)


def like(**attributes):
    """The toy, but with these class attributes."""
    return type("Toy", (Toy,), attributes)


def checkpoint(out, name="last"):
    return torch.load(Path(out) / "checkpoints" / f"{name}.ckpt", weights_only=True)


def rows(out):
    with (Path(out) / "log.csv").open() as file:
        return list(csv.DictReader(file))


def assert_same(a, b, where=""):
    """Everything in two nested states is equal, tensors by every bit."""
    assert type(a) is type(b), where
    if isinstance(a, torch.Tensor):
        assert torch.equal(a, b), where
    elif isinstance(a, dict):
        assert a.keys() == b.keys(), where
        for key in a:
            assert_same(a[key], b[key], f"{where}.{key}")
    elif isinstance(a, list | tuple):
        assert len(a) == len(b), where
        for position, (left, right) in enumerate(zip(a, b, strict=True)):
            assert_same(left, right, f"{where}[{position}]")
    else:
        assert a == b, where


def assert_same_training(out, other):
    for name in ("last", "best"):
        left, right = checkpoint(out, name), checkpoint(other, name)
        for key in ("state_dict", "optimizer_states", "global_step"):
            assert_same(left[key], right[key], f"{name}.{key}")
        assert left["callbacks"]["Keeper"]["best"] == right["callbacks"]["Keeper"]["best"]
    assert_same(
        dict(load_weights(Path(out, "toy.safetensors")).tensors),
        dict(load_weights(Path(other, "toy.safetensors")).tensors),
    )


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A training of 20 steps without interruption."""
    out = tmp_path_factory.mktemp("whole") / "run"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(keeper, "plot_training", lambda rows, path: None)
        outcome = run(out)
    assert (outcome.steps, outcome.signal) == (20, None)
    return out


@pytest.mark.parametrize("step", [3, 10, 13])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_an_interrupted_training_continues_bit_for_bit(whole, step, number):
    outcome = run("run", like(signal_at=(step, number)))
    assert (outcome.steps, outcome.signal) == (step, number)
    assert checkpoint("run")["global_step"] == step
    assert signal.getsignal(number) in (signal.default_int_handler, signal.SIG_DFL), "the signals are given back"
    outcome = run("run")
    assert (outcome.steps, outcome.signal) == (20, None)
    assert_same_training("run", whole)


def test_after_a_crash_it_continues_from_the_last_checkpoint_and_logs_no_step_twice(whole):
    with pytest.raises(RuntimeError, match="the toy broke"):
        run("run", like(crash_at=18))
    assert checkpoint("run")["global_step"] == 10
    assert [int(row["step"]) for row in rows("run")] == [4, 8, 10, 12, 16]
    run("run")
    assert_same_training("run", whole)
    assert [int(row["step"]) for row in rows("run")] == [int(row["step"]) for row in rows(whole)]


def test_a_signal_at_the_last_step_is_no_interruption():
    outcome = run("run", like(signal_at=(20, signal.SIGINT)))
    assert (outcome.steps, outcome.signal) == (20, None)


def test_a_finished_training_is_not_done_again(whole):
    before = {path: path.stat().st_mtime_ns for path in (whole / "checkpoints").iterdir()}
    outcome = run(whole, like(crash_at=1))
    assert (outcome.steps, outcome.best["step"]) == (20, checkpoint(whole)["callbacks"]["Keeper"]["best"]["step"])
    assert {path: path.stat().st_mtime_ns for path in (whole / "checkpoints").iterdir()} == before


def test_loader_processes_change_nothing_but_who_makes_the_samples(whole):
    run("run", recipe=toy_recipe(loader_workers=2))
    assert_same_training("run", whole)
    assert rows("run")[-1]["loss.fit"] == rows(whole)[-1]["loss.fit"]


def test_another_seed_is_another_training(whole):
    run("run", recipe=toy_recipe(seed=1))
    first, other = checkpoint("run")["state_dict"], checkpoint(whole)["state_dict"]
    assert not torch.equal(first["network.0.weight"], other["network.0.weight"])


def test_nothing_is_written_elsewhere_and_nothing_is_said(here, capfd):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run("run")
    assert [path.name for path in here.iterdir()] == ["run"]
    assert {path.relative_to(here / "run").as_posix() for path in (here / "run").rglob("*") if path.is_file()} == {
        *("recipe.toml", "log.csv", "toy.safetensors", "toy.json", "lock"),
        *("checkpoints/last.ckpt", "checkpoints/best.ckpt"),
    }
    assert capfd.readouterr() == ("", "")


def test_the_log_has_every_term_averaged_and_the_validations(whole):
    table = rows(whole)
    assert [int(row["step"]) for row in table] == [4, 8, 10, 12, 16, 20]
    assert list(table[0]) == [
        *("step", "seconds", "learning_rate", "loss.fit", "loss.size", "loss.total"),
        *("validation.error", "validation.random"),
    ]
    for row in table:
        assert math.isclose(float(row["loss.total"]), float(row["loss.fit"]) + float(row["loss.size"]), rel_tol=1e-4)
        assert bool(row["validation.error"]) == (int(row["step"]) % 10 == 0)
    # Each validation draws the same random numbers, so that figures can be compared.
    assert len({row["validation.random"] for row in table if row["validation.random"]}) == 1


def test_a_training_learns():
    outcome = run("run", recipe=toy_recipe(steps=200, learning_rate=0.1, batch=16, method={"random": False}))
    assert outcome.best["figures"]["error"] < 0.05
    assert float(rows("run")[-1]["loss.fit"]) < 0.05 < 1 < float(rows("run")[0]["loss.fit"])


def test_the_losses_of_a_row_are_the_mean_over_its_steps():
    run("one", recipe=toy_recipe(log_every=1))
    run("four", recipe=toy_recipe(log_every=4, validate_every=20, checkpoint_every=20))
    single = [float(row["loss.fit"]) for row in rows("one")]
    assert math.isclose(float(rows("four")[1]["loss.fit"]), sum(single[4:8]) / 4, rel_tol=1e-5)


def test_the_card_says_what_made_the_weights(whole):
    weights = load_weights(whole / "toy.safetensors")
    card, best = weights.card, checkpoint(whole)["callbacks"]["Keeper"]["best"]
    assert card["configuration"] == {"width": 4, "random": True, "pace_s": 0.0}
    assert card["recipe"] == toy_recipe().as_dict()
    assert (card["method"], card["seed"], card["monitor"]) == ("toy", 0, "error")
    assert card["steps"] == best["step"]
    assert card["validation"] == best["figures"]
    assert card["torch"] == torch.__version__
    assert "1 thread" in card["device"]
    assert card["started_from"] is None
    assert [point["samples"] for point in card["curve"]] == [60, 120][: len(card["curve"])]
    assert card["curve"][-1]["samples"] == card["steps"] * 6
    assert card["curve"][-1]["error"] == pytest.approx(best["figures"]["error"], rel=1e-5)


def test_the_averaged_weights_are_shipped(whole):
    tensors, best = load_weights(whole / "toy.safetensors").tensors, checkpoint(whole, "best")["state_dict"]
    for name, tensor in tensors.items():
        assert torch.equal(tensor, best[f"average.{name}"])
    assert not torch.equal(tensors["0.weight"], best["network.0.weight"])


def test_without_averaging_the_network_itself_is_shipped():
    run("run", recipe=toy_recipe(average=0.0))
    tensors, best = load_weights(Path("run/toy.safetensors")).tensors, checkpoint("run", "best")["state_dict"]
    assert not any(name.startswith("average.") for name in best)
    for name, tensor in tensors.items():
        assert torch.equal(tensor, best[f"network.{name}"])


def test_the_best_weights_are_kept_when_later_ones_are_worse():
    figures = iter([3.0, 1.0, float("nan"), 2.0])

    class Wavering(Toy):
        def validate(self, network):
            return {"error": next(figures)}

    outcome = run("run", Wavering, toy_recipe(validate_every=5))
    assert outcome.best == {"step": 10, "figures": {"error": 1.0}}
    assert load_weights(Path("run/toy.safetensors")).card["steps"] == 10
    assert checkpoint("run", "best")["global_step"] == 10


def test_hours_accumulate_over_interruptions():
    run("run", like(signal_at=(5, signal.SIGINT)), toy_recipe(method={"pace_s": 0.05}))
    before = checkpoint("run")["callbacks"]["Keeper"]["seconds"]
    assert before > 0.2
    run("run", recipe=toy_recipe(method={"pace_s": 0.05}))
    assert checkpoint("run")["callbacks"]["Keeper"]["seconds"] > before + 0.7
    seconds = [float(row["seconds"]) for row in rows("run")]
    assert seconds == sorted(seconds)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"batch": 8}, "training.batch = 6, this one has 8; give another --out"),
        ({"method": {"width": 5}}, "method.width = its default, this one has 5"),
        ({"steps": 10}, "only more steps of a constant schedule"),
        ({"steps": 40}, "training.steps = 20, this one has 40; only more steps of a constant schedule"),
    ],
)
def test_a_changed_recipe_is_refused(whole, change, words):
    before = (whole / "recipe.toml").read_text()
    with pytest.raises(UserError, match=words):
        run(whole, recipe=toy_recipe(**change))
    assert (whole / "recipe.toml").read_text() == before


def test_a_constant_schedule_may_be_given_more_steps():
    run("run", recipe=toy_recipe(schedule="constant"))
    outcome = run("run", recipe=toy_recipe(schedule="constant", steps=30, loader_workers=1))
    assert outcome.steps == 30
    assert int(rows("run")[-1]["step"]) == 30
    assert {row["learning_rate"] for row in rows("run")[1:]} == {"0.01"}
    with pytest.raises(UserError, match=r"training.steps = 30, this one has 20"):
        run("run", recipe=toy_recipe(schedule="constant"))


def test_training_may_start_from_weights(whole):
    start = whole / "toy.safetensors"
    run("run", recipe=toy_recipe(learning_rate=1e-12, weight_decay=0.0, average=0.0), start=start)
    shipped, given = load_weights(Path("run/toy.safetensors")), load_weights(start)
    for name in ("0.weight", "0.bias"):
        torch.testing.assert_close(shipped.tensors[name], given.tensors[name], rtol=0, atol=1e-6)
    assert shipped.card["started_from"] == given.card["sha256"]
    first = {"samples": given.card["steps"] * 6, "hours": given.card["hours"]}
    assert shipped.card["before"] == {**first, "hours_by_device": {given.card["device"]: given.card["hours"]}}
    assert shipped.card["curve"][: len(given.card["curve"])] == given.card["curve"]
    assert shipped.card["curve"][-1]["samples"] == first["samples"] + shipped.card["steps"] * 6
    assert training_words(Path("run/toy.safetensors")).startswith(
        f"supervision not stated, {first['samples'] + shipped.card['steps'] * 6:,} samples, "
    )
    with pytest.raises(UserError, match="--from now asks for fresh weights; give another --out"):
        run("run", recipe=toy_recipe(learning_rate=1e-12, weight_decay=0.0, average=0.0))


def test_weights_of_another_model_do_not_start_a_training(whole):
    with pytest.raises(UserError, match="made for another model"):
        run("run", recipe=toy_recipe(method={"width": 5}), start=whole / "toy.safetensors")


def test_a_loss_that_is_not_finite_ends_the_training_and_is_named():
    with pytest.raises(UserError) as error:
        run("run", like(nan_at=14))
    message = str(error.value)
    assert "the loss term 'fit' is nan at step 14; the checkpoint of step 10 is kept" in message
    assert "\n" not in message
    assert checkpoint("run")["global_step"] == 10
    assert torch.isfinite(checkpoint("run")["state_dict"]["network.0.weight"]).all()
    assert int(rows("run")[-1]["step"]) == 12


def test_weights_that_are_not_finite_are_not_saved():
    class Root(Toy):
        def losses(self, network, batch, progress):
            return {"root": network(0 * batch["x"]).sum().sub(network(0 * batch["x"]).sum()).abs().sqrt()}

    recipe = toy_recipe(checkpoint_every=1, clip_gradient_norm=0.0, method={"random": False})
    with pytest.raises(UserError, match=r"the weight '0.weight' is not finite after step 1; no checkpoint was due yet"):
        run("run", Root, recipe)
    assert not list(Path("run/checkpoints").iterdir())


@pytest.mark.parametrize(
    ("losses", "words"),
    [
        (lambda loss: {}, "there is no term to minimise"),
        (lambda loss: {"total": loss}, "the term 'total' is a name kept for the sum"),
        (lambda loss: {"fit": loss.expand(2)}, r"the term 'fit' is of shape \[2\], not a scalar"),
    ],
)
def test_losses_that_are_no_scalars_are_refused(losses, words):
    class Wrong(Toy):
        def losses(self, network, batch, progress):
            return losses(network(batch["x"]).sum())

    with pytest.raises(UserError, match=words):
        run("run", Wrong)


def test_a_validation_without_the_monitored_figure_is_refused():
    class Wrong(Toy):
        def validate(self, network):
            return {"eror": 1.0}

    with pytest.raises(UserError, match=r"gives no 'error', which is its `monitor` \(it gives: eror\)"):
        run("run", Wrong)


def test_a_training_is_not_continued_on_other_data_or_by_other_networks():
    run("run", like(signal_at=(5, signal.SIGINT)))
    other_data = like(card=lambda self: {"data": "others", "configuration": self.table.model_dump()})
    with pytest.raises(UserError, match="holds a training whose data is none, now it is others"):
        run("run", other_data)
    other_networks = like(network=lambda self: torch.nn.Sequential(torch.nn.Linear(3, 5), torch.nn.Linear(5, 2)))
    with pytest.raises(UserError, match=r"last\.ckpt: of another version of toy, whose networks are others"):
        run("run", other_networks)
    assert run("run").steps == toy_recipe().training.steps


def test_checkpoints_are_replaced_whole(here):
    run("run")
    assert sorted(path.name for path in (here / "run" / "checkpoints").iterdir()) == ["best.ckpt", "last.ckpt"]


def test_a_method_may_fill_in_its_settings():
    def init(self, settings, *, data):
        Toy.__init__(self, settings, data=data)
        self.settings = self.table.model_dump()

    run("run", like(__init__=init))
    assert "pace_s = 0.0" in Path("run/recipe.toml").read_text()
    assert json.loads(Path("run/toy.json").read_text())["recipe"]["method"]["width"] == 4


def test_a_damaged_checkpoint_is_named(whole, here):
    run("run", like(signal_at=(5, signal.SIGINT)))
    path = Path("run/checkpoints/last.ckpt")
    path.write_bytes(path.read_bytes()[:100])
    with pytest.raises(UserError, match=r"last\.ckpt: cannot be read .*copy best\.ckpt over it"):
        run("run")


def test_the_best_checkpoint_can_take_the_place_of_the_last(whole):
    run("run", like(signal_at=(15, signal.SIGINT)))
    Path("run/checkpoints/best.ckpt").replace("run/checkpoints/last.ckpt")
    run("run")
    assert_same_training("run", whole)


def test_a_folder_that_is_no_training_is_refused():
    Path("run").mkdir()
    Path("run/thesis.tex").write_text("")
    with pytest.raises(UserError, match="is not empty and not a training; give another --out"):
        run("run")
    assert [path.name for path in Path("run").iterdir()] == ["thesis.tex"]
    Path("file").write_text("")
    with pytest.raises(UserError, match=r"file: cannot be made \(Not a directory|File exists\)"):
        run("file")


def test_two_trainings_do_not_share_a_folder():
    with engine.TrainingFolder(Path("run"), "toy").locked(), pytest.raises(UserError, match="another training"):
        run("run")


@pytest.mark.parametrize("module", ["lightning", "matplotlib"])
def test_what_is_not_installed_is_named(monkeypatch, module):
    real = engine.importlib.util.find_spec
    monkeypatch.setattr(engine.importlib.util, "find_spec", lambda name: None if name == module else real(name))
    with pytest.raises(UserError, match=rf'training needs {module}, .*pip install "regbench\[train\]"'):
        run("run")
    assert not Path("run").exists()


def test_cuda_that_is_not_there_is_refused():
    if torch.cuda.is_available():
        pytest.skip("there is a CUDA device")
    with pytest.raises(UserError, match="--device cuda: torch finds no CUDA device here"):
        run("run", device="cuda")


def test_devices_must_share_a_batch_evenly():
    with pytest.raises(UserError, match=r"training.batch = 6 cannot be shared evenly by --devices 4"):
        run("run", devices=4)


@pytest.mark.parametrize("precision", ["bf16-mixed", "64-true"])
def test_other_precisions(precision):
    run("run", recipe=toy_recipe(precision=precision))
    dtype = load_weights(Path("run/toy.safetensors")).tensors["0.weight"].dtype
    assert dtype == (torch.float64 if precision == "64-true" else torch.float32)


def test_two_devices_make_the_same_steps_as_one(here):
    """Two CPU processes stand for two GPUs: the same samples, the gradient averaged, so nearly the same weights."""
    recipe = toy_recipe(method={"random": False}, clip_gradient_norm=0.0)
    Path("toy.toml").write_text(recipe.as_toml())
    plugin = Path(__file__).parent / "toy_training.py"
    command = [sys.executable, "-m", "regbench", "train", "toy", "--plugin", str(plugin), "--recipe", "toy.toml"]
    command += ["--device", "cpu", "--threads", "1", "--devices", "2", "--out", "two"]
    answer = subprocess.run(command, capture_output=True, text=True, timeout=200)
    assert answer.returncode == 0, answer.stderr
    assert answer.stdout.count("20 steps done") == 1
    run("one", recipe=recipe)
    one, two = (load_weights(Path(out, "toy.safetensors")).tensors for out in ("one", "two"))
    for name, tensor in one.items():
        torch.testing.assert_close(two[name], tensor, rtol=1e-4, atol=1e-5)
    assert rows("two")[2]["loss.fit"][:4] == rows("one")[2]["loss.fit"][:4], "losses are averaged over the processes"


def test_the_picture_is_drawn_at_validations(whole):
    run("run", like(signal_at=(12, signal.SIGINT)))
    assert Path("run/losses.png").read_bytes().startswith(b"\x89PNG")
    assert json.loads(Path("run/toy.json").read_text())["steps"] == 10


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_before_the_first_step_is_obeyed_after_it(number):
    class Early(Toy):
        def network(self):
            return super().network()

        def sample(self, rng, progress):
            if progress == 0 and not Early.sent:
                Early.sent = True
                signal.raise_signal(number)
            return super().sample(rng, progress)

        sent = False

    outcome = run("run", Early)
    assert (outcome.steps, outcome.signal) == (1, number)
    assert checkpoint("run")["global_step"] == 1
