"""Compiled loops leave torch's threads as they were."""

import pytest
import torch

from regbench.learning.layers.neighbours import nearest_neighbours


@pytest.mark.parametrize("threads", [1, 2])
def test_torch_keeps_its_threads_where_numba_shares_its_openmp(threads):
    before = torch.get_num_threads()
    torch.set_num_threads(threads)
    try:
        nearest_neighbours(torch.rand(1, 50, 3), 4)
        assert torch.get_num_threads() == threads
    finally:
        torch.set_num_threads(before)
