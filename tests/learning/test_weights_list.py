import pytest
import torch

from regbench.learning.weights import card_path, save_weights
from regbench.learning.weights_list import HEADER, weights_in, words

CARD = {"steps": 1500, "hours": 2.25, "device": "H200", "monitor": "error", "validation": {"error": 1.23456}}


@pytest.fixture
def folder(tmp_path):
    save_weights(tmp_path / "good.safetensors", {"w": torch.zeros(10, 100), "b": torch.zeros(5)}, CARD)
    save_weights(tmp_path / "bare.safetensors", {"w": torch.zeros(2)}, {})
    save_weights(tmp_path / "odd.safetensors", {"w": torch.zeros(2)}, {"steps": "many", "validation": [1], "hours": {}})
    save_weights(tmp_path / "cut.safetensors", {"w": torch.zeros(10)}, CARD)
    path = tmp_path / "cut.safetensors"
    path.write_bytes(path.read_bytes()[:-1])
    save_weights(tmp_path / "lonely.safetensors", {"w": torch.zeros(10)}, CARD)
    card_path(tmp_path / "lonely.safetensors").unlink()
    return tmp_path


def test_every_file_is_listed_the_damaged_with_its_reason(folder):
    entries = {entry["name"]: entry for entry in weights_in(folder, "toy")}
    assert sorted(entries) == ["bare", "cut", "good", "lonely", "odd"]
    assert entries["good"]["ok"]
    assert entries["good"]["parameters"] == 1005
    assert entries["good"]["validation"] == {"error": 1.23456}
    assert not entries["cut"]["ok"]
    assert "SHA-256" in entries["cut"]["reason"]
    assert "cannot read" in entries["lonely"]["reason"]


def test_the_words_of_a_row(folder):
    found = {entry["name"]: dict(zip(HEADER, words(entry), strict=True)) for entry in weights_in(folder, "toy")}
    good = found["good"]
    assert good == {"name": "good", "method": "toy", "parameters": "1,005", "MB": "0.00", "steps": "1,500"} | {
        "hours": "2.25",
        "device": "H200",
        "validation": "error 1.235",
        "sha256": "ok",
    }
    assert found["bare"]["steps"] == ""
    assert found["odd"]["steps"] == "many"
    assert found["cut"]["sha256"].startswith("damaged: weights ")


def test_a_folder_that_is_not_there_holds_no_weights(tmp_path):
    assert weights_in(tmp_path / "gone", "toy") == []
