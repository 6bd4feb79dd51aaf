"""Compiled loops leave torch's threads as they were."""

import subprocess
import sys

import pytest

CODE = """
import torch
from regbench.learning.layers.neighbours import nearest_neighbours
for threads in (1, 2, 1):
    torch.set_num_threads(threads)
    for _ in range(2):
        nearest_neighbours(torch.rand(1, 50, 3), 4)
        assert torch.get_num_threads() == threads, (threads, torch.get_num_threads())
"""


@pytest.mark.parametrize("numba_threads", ["1", "2"])
def test_torch_keeps_its_threads_where_numba_shares_its_openmp(numba_threads, monkeypatch):
    monkeypatch.setenv("NUMBA_NUM_THREADS", numba_threads)
    # A process of its own: numba's threads begin once, and that changed torch's number.
    subprocess.run([sys.executable, "-c", CODE], check=True)
