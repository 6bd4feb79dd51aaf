"""Weights by name, from the package, or by path."""

import json

import pytest
import torch

from regbench.errors import UserError
from regbench.learning.weights import save_weights
from regbench.testing import clouds
from regbench_latentcem import weight_files
from regbench_latentcem.model import Configuration, LatentModel
from regbench_latentcem.registrar import LatentCem
from regbench_latentcem.weight_files import weight_files as files_of_package


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder in the place of the package's, with random weights a.safetensors."""
    torch.manual_seed(0)
    configuration = Configuration()
    tensors = LatentModel(configuration).without_decoder().state_dict()
    save_weights(tmp_path / "a.safetensors", tensors, {"configuration": configuration.as_card()})
    monkeypatch.setattr(weight_files, "FOLDER", tmp_path)
    return tmp_path


def test_a_name_is_of_the_package_and_a_path_is_a_path(folder, monkeypatch):
    assert (
        files_of_package().path("a")
        == files_of_package().path(str(folder / "a.safetensors"))
        == folder / "a.safetensors"
    )
    problem, _ = clouds.easy_problem(100)
    small = {"T": 2, "N": 50, "K": 5}
    by_name = LatentCem(weights="a", **small).register(problem)
    by_path = LatentCem(weights=str(folder / "a.safetensors"), **small).register(problem)
    assert by_name.T_target_source.tobytes() == by_path.T_target_source.tobytes()


def test_missing_weights_are_named(folder):
    with pytest.raises(UserError, match=r"no weights 'b' in .* \(there: a\)"):
        files_of_package().path("b")
    with pytest.raises(UserError, match=r"weights gone/a\.safetensors: no such file"):
        LatentCem(weights="gone/a.safetensors").prepare()


@pytest.mark.parametrize(
    ("changed", "reason"),
    [
        ({"transformation_widths": 5}, "transformation_widths: Input should be a valid tuple"),
        ({"transformation_widths": [8, 8, 8]}, "transformation_widths: Tuple should have at most 2"),
        ({"start_rad": None}, "start_rad: Input should be a valid number"),
        ({"widths": 5}, "widths: Unexpected"),
        ("dgcnn", "configuration"),
    ],
)
def test_a_card_that_is_not_latentcems_is_refused_in_one_line(folder, changed, reason):
    path = folder / "a.json"
    card = json.loads(path.read_text())
    card["configuration"] = {**card["configuration"], **changed} if isinstance(changed, dict) else changed
    path.write_text(json.dumps(card))
    with pytest.raises(UserError, match=reason) as raised:
        LatentCem(weights="a").prepare()
    assert "\n" not in str(raised.value)
