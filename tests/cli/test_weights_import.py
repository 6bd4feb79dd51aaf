"""regbench weights import: original checkpoints become weights of ours, and wrong files a clear line."""

from itertools import pairwise

import pytest
import torch
from regbench_baselines.pointnetlk.registrar import PointNetLk
from torch import nn
from typer.testing import CliRunner

from regbench.cli.main import app
from regbench.contract import Problem
from regbench.learning.weights import load_weights
from regbench.testing.clouds import body


def block(sizes):
    layers = []
    for size, width in pairwise(sizes):
        layers += [nn.Conv1d(size, width, 1), nn.BatchNorm1d(width), nn.ReLU()]
    return nn.Sequential(*layers)


class Original(nn.Module):
    """The modules' names of PointNetLK's authors."""

    def __init__(self, scale=8):
        super().__init__()
        self.h1 = block([3, 64 // scale, 64 // scale])
        self.h2 = block([64 // scale, 64 // scale, 128 // scale, 1024 // scale])

    def forward(self, points):
        return self.h2(self.h1(points.transpose(1, 2))).max(dim=2).values


class Revisited(nn.Module):
    """Those of PointNetLK Revisited's."""

    def __init__(self):
        super().__init__()
        self.mlp1, self.mlp2, self.mlp3 = block([3, 8]), block([8, 16]), block([16, 64])

    def forward(self, points):
        return self.mlp3(self.mlp2(self.mlp1(points.transpose(1, 2)))).max(dim=2).values


def made(network):
    torch.manual_seed(0)
    for norm in network.modules():
        if isinstance(norm, nn.BatchNorm1d):
            nn.init.normal_(norm.running_mean)
            nn.init.uniform_(norm.running_var, 0.5, 2)
    return network.eval()


def run(*arguments):
    return CliRunner().invoke(app, ["weights", "import", *map(str, arguments)])


WRAPPED = {
    "bare": lambda state: state,
    "loop": lambda state: {f"ptnet.{name}": tensor for name, tensor in state.items()},
    "parallel": lambda state: {"epoch": 3, "model": {f"module.ptnet.{name}": value for name, value in state.items()}},
}


@pytest.mark.parametrize("wrapping", WRAPPED)
@pytest.mark.parametrize("cls", [Original, Revisited])
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
    torch.save(content(Original().state_dict()), file)
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
    torch.save(Original().state_dict(), file)
    out.write_text("mine")
    assert "exists" in str(run("pointnetlk", file, "--out", out).exception)
    assert out.read_text() == "mine"


def test_text_truncated_and_missing_files_are_named(tmp_path):
    text, cut = tmp_path / "text.pth", tmp_path / "cut.pth"
    text.write_text("no checkpoint")
    torch.save(Original().state_dict(), cut)
    cut.write_bytes(cut.read_bytes()[:1000])
    for file in (text, cut, tmp_path / "missing.pth"):
        result = run("pointnetlk", file, "--out", tmp_path / "out.safetensors")
        assert file.name in str(result.exception)


def test_a_method_without_known_names_says_so(tmp_path):
    file = tmp_path / "a.pth"
    torch.save(Original().state_dict(), file)
    result = run("latentcem", file, "--out", tmp_path / "out.safetensors")
    assert "no other implementation's names are known" in str(result.exception)
