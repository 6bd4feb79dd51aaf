"""Weights by name, from the package, or by path."""

import pytest
import torch

from regbench.errors import UserError
from regbench.learning.weights import save_weights
from regbench.testing import clouds
from regbench_latentcem import weight_files
from regbench_latentcem.model import Configuration, LatentModel
from regbench_latentcem.registrar import LatentCem
from regbench_latentcem.weight_files import weights_path


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
    assert weights_path("a") == weights_path(str(folder / "a.safetensors")) == folder / "a.safetensors"
    problem, _ = clouds.easy_problem(100)
    small = {"T": 2, "N": 50, "K": 5}
    by_name = LatentCem(weights="a", **small).register(problem)
    by_path = LatentCem(weights=str(folder / "a.safetensors"), **small).register(problem)
    assert by_name.T_target_source.tobytes() == by_path.T_target_source.tobytes()


def test_missing_weights_are_named(folder):
    with pytest.raises(UserError, match=r"no weights 'b' in .* \(there: a\)"):
        weights_path("b")
    with pytest.raises(UserError, match=r"weights gone/a\.safetensors: no such file"):
        LatentCem(weights="gone/a.safetensors").prepare()
