"""regbench weights import: original checkpoints become weights of ours, and wrong files a clear line."""

import pytest
import torch
from regbench_baselines.dcp.registrar import Dcp
from regbench_baselines.idam.registrar import Idam
from regbench_baselines.pointnetlk.registrar import PointNetLk
from torch import nn
from typer.testing import CliRunner

from regbench.cli.main import app
from regbench.contract import Problem
from regbench.learning.weights import load_weights
from regbench.testing.clouds import body

from . import original_networks as originals


def made(network):
    torch.manual_seed(0)
    for layer in network.modules():
        if isinstance(layer, nn.BatchNorm1d | nn.BatchNorm2d):
            nn.init.normal_(layer.running_mean, std=0.3)
            nn.init.uniform_(layer.running_var, 0.5, 2)
        elif isinstance(layer, nn.Conv1d | nn.Conv2d):
            nn.init.kaiming_normal_(layer.weight, nonlinearity="relu")  # else differences drown in rounding
    return network.eval()


def run(*arguments):
    return CliRunner().invoke(app, ["weights", "import", *map(str, arguments)])


WRAPPED = {
    "bare": lambda state: state,
    "loop": lambda state: {f"ptnet.{name}": tensor for name, tensor in state.items()},
    "parallel": lambda state: {"epoch": 3, "model": {f"module.ptnet.{name}": value for name, value in state.items()}},
}


@pytest.mark.parametrize("wrapping", WRAPPED)
@pytest.mark.parametrize("cls", [originals.PointNetLk, originals.Revisited])
def test_an_original_checkpoint_gives_the_same_features(tmp_path, cls, wrapping):
    original = made(cls())
    file, out = tmp_path / "model_best.pth", tmp_path / "there" / "mine.safetensors"
    torch.save(WRAPPED[wrapping](original.state_dict()), file)
    result = run("pointnetlk", file, "--out", out)
    assert result.exit_code == 0, result.output
    assert f"pointnetlk[weights={out}]" in result.output
    method = PointNetLk(weights=str(out))
    method.prepare()
    cloud = torch.from_numpy(body(100)).float()[None]
    torch.testing.assert_close(method._network.encoder(cloud), original(cloud), atol=1e-5, rtol=1e-4)
    assert method.register(Problem(source=body(50), target=body(50))).T_target_source.shape == (4, 4)
    card = load_weights(out).card
    assert card["source"]["file"] == "model_best.pth"
    assert len(card["source"]["sha256"]) == 64


@pytest.mark.parametrize(
    ("name", "original", "cls", "options"),
    [
        ("dcp", originals.Dcp, Dcp, {}),
        ("idam", originals.Idam, Idam, Idam.presets["paper"]),
    ],
)
def test_an_original_checkpoint_gives_the_same_motion(tmp_path, name, original, cls, options):
    network = made(original()).double()
    if name == "idam":  # else the features alone decide, and all source points have the same partner
        for block in network.sim_mat_conv1:
            block.conv[0].conv.weight.data[:, :128] *= 0.01
    file, out = tmp_path / "model.t7", tmp_path / "mine.safetensors"
    torch.save({f"module.{key}": value for key, value in network.state_dict().items()}, file)
    result = run(name, file, "--out", out)
    assert result.exit_code == 0, result.output
    method = cls(weights=str(out), **options)
    method.prepare()
    source, target = (torch.from_numpy(body(420, seed=seed)) for seed in (0, 1))
    T_target_source = method._network.double().align(source[None], target[None], **method.options()).T_target_source[0]
    with torch.inference_mode():
        R, t = network(source, target)
    torch.testing.assert_close(T_target_source[:3, :3], R, atol=1e-4, rtol=0)
    torch.testing.assert_close(T_target_source[:3, 3], t, atol=1e-4, rtol=0)


@pytest.mark.parametrize(
    ("name", "original", "content", "words"),
    [
        ("dcp", originals.Dcp, {"pointer.model.encoder.norm.a_2": torch.ones(32)}, "'pointer.model.encoder.norm.a_2'"),
        ("dcp", originals.Dcp, {"emb_nn.conv2.weight": torch.zeros(64, 64, 3, 3)}, "no convolution of width 1"),
        ("dcp", originals.Dcp, {"emb_nn.bn5.weight": torch.zeros(7)}, "'emb_nn.bn5.weight' has 7 channels"),
        ("dcp", originals.Dcp, {"emb_nn.conv5.weight": torch.zeros(32, 64, 1, 1)}, "made for another model"),
        ("dcp", originals.Idam, {}, "it has no 'emb_nn.conv1.weight'"),
        ("idam", originals.Idam, {"transformer.a": torch.ones(1)}, "'transformer.a' belongs to no layer"),
        ("idam", originals.Dcp, {}, "it has no 'emb_nn.propogate1.conv2d.conv.0.conv.weight'"),
    ],
)
def test_a_checkpoint_of_another_network_is_one_line(tmp_path, name, original, content, words):
    file, out = tmp_path / "wrong.pth", tmp_path / "out.safetensors"
    torch.save({**original().state_dict(), **content}, file)
    result = run(name, file, "--out", out)
    assert result.exit_code != 0
    assert words in " ".join(str(result.exception or result.output).split())
    assert not out.exists()


class Unpickled:
    """Writes a file when it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return open, (str(self.path), "w")


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (lambda state: {**state, "tnet1.lin.weight": torch.zeros(9, 256)}, "'tnet1.lin.weight' belongs to no layer"),
        (lambda state: {name: t for name, t in state.items() if name != "h2.6.bias"}, "it has no 'h2.6.bias'"),
        (lambda state: {"conv.weight": torch.zeros(2)}, "it has no 'h1.0.weight' (it begins with 'conv.weight')"),
        (lambda state: {**state, "h2.0.weight": torch.zeros(8, 5, 1)}, "made for another model"),
        (lambda state: [1, 2, 3], "no state_dict"),
        (lambda state: {"epoch": 3}, "no state_dict"),
    ],
)
def test_a_wrong_file_is_one_line_and_nothing_is_written(tmp_path, content, words):
    file, out = tmp_path / "wrong.pth", tmp_path / "out.safetensors"
    torch.save(content(originals.PointNetLk().state_dict()), file)
    result = run("pointnetlk", file, "--out", out)
    assert result.exit_code != 0
    assert words in " ".join(str(result.exception or result.output).split())
    assert not out.exists()


def test_no_code_of_a_file_is_run(tmp_path):
    file, trace = tmp_path / "evil.pth", tmp_path / "trace"
    torch.save({"state_dict": Unpickled(trace)}, file)
    result = run("pointnetlk", file, "--out", tmp_path / "out.safetensors")
    assert result.exit_code != 0
    assert not trace.exists()


def test_a_file_that_is_there_is_kept(tmp_path):
    file, out = tmp_path / "a.pth", tmp_path / "out.safetensors"
    torch.save(originals.PointNetLk().state_dict(), file)
    out.write_text("mine")
    assert "exists" in str(run("pointnetlk", file, "--out", out).exception)
    assert out.read_text() == "mine"


def test_text_truncated_and_missing_files_are_named(tmp_path):
    text, cut = tmp_path / "text.pth", tmp_path / "cut.pth"
    text.write_text("no checkpoint")
    torch.save(originals.PointNetLk().state_dict(), cut)
    cut.write_bytes(cut.read_bytes()[:1000])
    for file in (text, cut, tmp_path / "missing.pth"):
        result = run("pointnetlk", file, "--out", tmp_path / "out.safetensors")
        assert file.name in str(result.exception)


def test_a_method_without_known_names_says_so(tmp_path):
    file = tmp_path / "a.pth"
    torch.save(originals.PointNetLk().state_dict(), file)
    result = run("latentcem", file, "--out", tmp_path / "out.safetensors")
    assert "no other implementation's names are known" in str(result.exception)
