"""Compiled loops leave torch's number of threads as it was."""

import subprocess
import sys

CODE = """
import torch
from regbench.learning.layers.ball_neighbours import ball_neighbours
torch.set_num_threads(1)
for _ in range(2):
    ball_neighbours(torch.zeros(1, 9, 3), 1.0, 4)
    assert torch.get_num_threads() == 1, torch.get_num_threads()
"""


def test_torch_keeps_its_threads():
    subprocess.run([sys.executable, "-c", CODE], check=True)
