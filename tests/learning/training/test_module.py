import torch
from torch import nn

from regbench.learning.training.module import move_average


def test_the_average_is_the_formula_and_buffers_are_copied():
    torch.manual_seed(0)
    average, network = nn.BatchNorm1d(3), nn.BatchNorm1d(3)
    nn.init.normal_(network.weight)
    network.running_mean.fill_(7.0)
    network.num_batches_tracked.fill_(5)
    before = average.weight.detach().clone()
    move_average(average, network, 0.75)
    torch.testing.assert_close(average.weight, 0.75 * before + 0.25 * network.weight)
    assert torch.equal(average.running_mean, network.running_mean)
    assert average.num_batches_tracked == 5
