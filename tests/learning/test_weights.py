import hashlib
import json
import pickle

import pytest
import torch
from torch import nn

from regbench.errors import UserError
from regbench.learning.weights import card_path, load_weights, save_weights


@pytest.fixture
def stored(tmp_path):
    torch.manual_seed(0)
    network = nn.Linear(3, 2)
    path = tmp_path / "model.safetensors"
    save_weights(path, network.state_dict(), {"data": "modelnet40", "steps": 7})
    return path, network


def test_tensors_come_back_bit_for_bit_with_their_card(stored):
    path, network = stored
    weights = load_weights(path)
    other = nn.Linear(3, 2)
    weights.load_into(other)
    assert torch.equal(other.weight, network.weight)
    assert torch.equal(other.bias, network.bias)
    assert weights.card == {"data": "modelnet40", "steps": 7, "sha256": hashlib.sha256(path.read_bytes()).hexdigest()}
    assert sorted(file.name for file in path.parent.iterdir()) == ["model.json", "model.safetensors"]


def test_half_precision_is_kept(tmp_path):
    path = tmp_path / "half.safetensors"
    save_weights(path, {"w": torch.ones(2, dtype=torch.bfloat16)}, {})
    assert load_weights(path).tensors["w"].dtype == torch.bfloat16


@pytest.mark.parametrize("length", [0, 5, 40, -1])
def test_a_truncated_file_is_refused(stored, length):
    path, _ = stored
    path.write_bytes(path.read_bytes()[:length])
    with pytest.raises(UserError, match=r"model\.safetensors: its SHA-256 is not the one in model\.json.*truncated"):
        load_weights(path)


@pytest.mark.parametrize("data", [b"", b"not tensors at all", pickle.dumps({"w": [1.0]}), b"\xff" * 64])
def test_a_foreign_file_is_refused_though_the_card_vouches_for_it(stored, data):
    path, _ = stored
    path.write_bytes(data)
    card_path(path).write_text(json.dumps({"sha256": hashlib.sha256(data).hexdigest()}))
    with pytest.raises(UserError, match=r"model\.safetensors: not a safetensors file"):
        load_weights(path)


def test_nothing_is_unpickled(stored, tmp_path):
    class Bomb:
        def __reduce__(self):
            return (open, (str(tmp_path / "exploded"), "w"))

    path, _ = stored
    data = pickle.dumps(Bomb())
    path.write_bytes(data)
    card_path(path).write_text(json.dumps({"sha256": hashlib.sha256(data).hexdigest()}))
    with pytest.raises(UserError):
        load_weights(path)
    assert not (tmp_path / "exploded").exists()


@pytest.mark.parametrize("text", ["{", "\udcff", "[1]"])
def test_a_broken_card_is_named(stored, text):
    path, _ = stored
    card_path(path).write_bytes(text.encode(errors="surrogateescape"))
    with pytest.raises(UserError, match=r"model card .*model\.json: not"):
        load_weights(path)


@pytest.mark.parametrize("suffix", [".safetensors", ".json"])
def test_a_missing_file_is_named(stored, suffix):
    path, _ = stored
    path.with_suffix(suffix).unlink()
    with pytest.raises(UserError, match=f"cannot read .*model{suffix}: No such file"):
        load_weights(path)


def test_weights_of_another_model_are_refused(stored):
    path, _ = stored
    with pytest.raises(UserError, match=r"tensor 'weight' is \[2, 3\], Linear needs \[2, 4\] \(1 such"):
        load_weights(path).load_into(nn.Linear(4, 2))
    with pytest.raises(UserError, match=r"tensor 'bias' is \[2\], Linear needs absent"):
        load_weights(path).load_into(nn.Linear(3, 2, bias=False))


def test_a_card_that_is_not_json_leaves_the_old_weights(stored):
    path, _ = stored
    before = path.read_bytes()
    with pytest.raises(UserError, match="card cannot be written as JSON"):
        save_weights(path, {"w": torch.ones(1)}, {"when": object()})
    assert path.read_bytes() == before


def test_the_name_must_say_what_it_is(tmp_path):
    with pytest.raises(UserError, match="must end in .safetensors"):
        save_weights(tmp_path / "model.pt", {}, {})
