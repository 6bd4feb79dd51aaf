"""On a GPU the learned baselines answer, and learn, what they do on a CPU."""

import numpy as np
import pytest
import torch
from regbench_baselines.idam.network import IdamNetwork
from regbench_baselines.rpmnet.network import RpmNet
from regbench_baselines.rpmnet.soft_matches import soft_matches

from regbench.testing.clouds import body

pytestmark = pytest.mark.skipif(not torch.cuda.is_available(), reason="no CUDA device here")


def clouds(count):
    return torch.tensor(np.stack([body(count, seed) for seed in range(3)]), dtype=torch.float32)


@pytest.mark.parametrize("kind", [RpmNet, IdamNetwork])
def test_answers(kind):
    torch.manual_seed(0)
    network = kind().eval()
    source, target = clouds(300), clouds(280)
    with torch.inference_mode():
        expected = network.align(source, target).T_target_source
        found = network.cuda().align(source.cuda(), target.cuda()).T_target_source.cpu()
    torch.testing.assert_close(found, expected, atol=1e-3, rtol=0)


def test_matches_and_their_gradients():
    generator = torch.Generator().manual_seed(0)
    inputs = [torch.randn(3, 70, 24, generator=generator), torch.randn(3, 50, 24, generator=generator), torch.ones(3)]
    points = torch.randn(3, 50, 3, generator=generator)
    found = {}
    for device in ("cpu", "cuda"):
        leaves = [each.detach().to(device).requires_grad_() for each in inputs]
        outputs = soft_matches(*leaves, points.to(device))
        loss = sum(each.square().sum() for each in outputs)
        found[device] = [each.detach().cpu() for each in (*outputs, *torch.autograd.grad(loss, leaves))]
    for one, other in zip(*found.values(), strict=True):
        torch.testing.assert_close(one, other, rtol=1e-3, atol=1e-4 * float(one.abs().max()))
