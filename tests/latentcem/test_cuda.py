"""On a GPU: the same answers as on the CPU. Where there is none, nothing here can be checked."""

import os
import signal
from dataclasses import replace

import numpy as np
import pytest
import torch

from regbench.learning.layers.neighbours import nearest_neighbours
from regbench.learning.training import engine
from regbench.learning.training.recipe import load_recipe
from regbench.testing import clouds
from regbench_latentcem.encoder import DgcnnEncoder
from regbench_latentcem.registrar import LatentCem
from regbench_latentcem.support import support_states
from regbench_latentcem.training import LatentCemTraining
from regbench_latentcem.weight_files import FOLDER

pytestmark = pytest.mark.skipif(not torch.cuda.is_available(), reason="no CUDA device here")


@pytest.mark.parametrize("parameters", [{}, {"model": "equivariant"}, {"model": "equivariant", "refine": "verify"}])
def test_the_answer_does_not_depend_on_the_device(parameters):
    problem, _ = clouds.easy_problem()
    on_either = [replace(problem, device=device) for device in ("cpu", "cuda")]
    one, other = (LatentCem(**parameters).register(each).T_target_source for each in on_either)
    np.testing.assert_allclose(one, other, atol=1e-3)


def test_states_do_not_depend_on_the_device():
    some = torch.randn(3, 200, 3, generator=torch.Generator().manual_seed(0))
    torch.testing.assert_close(support_states(some.cuda()).cpu(), support_states(some), rtol=0, atol=1e-5)


def test_the_encoder_does_not_depend_on_the_device_nor_do_its_gradients():
    """With random weights: the neighbours of every layer count."""
    torch.manual_seed(0)
    some = torch.randn(2, 300, 3) * 0.5
    gradients, answers = [], []
    for device in ("cpu", "cuda"):
        torch.manual_seed(1)
        encoder = DgcnnEncoder().to(device)
        answers.append(encoder(some.to(device)))
        answers[-1].square().sum().backward()
        gradients.append([parameter.grad.cpu() for parameter in encoder.parameters()])
    torch.testing.assert_close(answers[1].cpu(), answers[0], rtol=1e-3, atol=1e-4)
    for one, other in zip(*gradients, strict=True):
        assert (one - other).norm() < 0.02 * one.norm()


def test_neighbours_are_those_of_the_cpu():
    torch.manual_seed(0)
    features = torch.randn(2, 300, 16)
    one, other = nearest_neighbours(features, 20), nearest_neighbours(features.cuda(), 20).cpu()
    same = [set(a.tolist()) == set(b.tolist()) for a, b in zip(one.flatten(0, 1), other.flatten(0, 1), strict=True)]
    assert np.mean(same) > 0.99  # rounding decides between equals


def test_a_training_of_every_part_is_interrupted_and_continues(prepared_data, tmp_path):
    over = {"training.steps": 12, "training.validate_every": 6, "training.log_every": 2}
    parts = {"method.alone_share": 0.4, "method.support_share": 0.7, "method.validated": 2}
    recipe = load_recipe(FOLDER / "modelnet40.toml", "latentcem", [*over.items(), *parts.items()])

    class Interrupted(LatentCemTraining):
        def losses(self, network, batch, progress):
            if progress == 0.5:
                os.kill(os.getpid(), signal.SIGINT)
            return super().losses(network, batch, progress)

    outcome = engine.train(Interrupted, recipe, tmp_path / "run", data=prepared_data, device="cuda")
    assert outcome.steps == 7
    outcome = engine.train(LatentCemTraining, recipe, tmp_path / "run", data=prepared_data, device="cuda")
    assert outcome.steps == 12
    assert outcome.best is not None
