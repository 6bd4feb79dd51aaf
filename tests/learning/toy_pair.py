"""A small method that aligns two clouds: network, training and registrar, as a plugin's author would write them."""

from pathlib import Path
from typing import ClassVar

import torch
from torch import nn

from regbench.learning.pair_network import Alignment, PairNetwork
from regbench.learning.pair_registrar import PairRegistrar
from regbench.learning.training.pair_trainable import PairTrainable
from regbench.learning.weight_files import WeightFiles


class ToyNetwork(PairNetwork):
    """Turns about z by an angle that a linear layer reads off the clouds' moments."""

    def __init__(self, *, width: int = 4):
        super().__init__()
        self.layers = nn.Sequential(nn.Linear(18, width), nn.ReLU(), nn.Linear(width, 1))

    def align(self, source, target, **options):
        moments = [(cloud[:, :, :, None] * cloud[:, :, None]).mean(dim=1).flatten(1) for cloud in (source, target)]
        angle = self.layers(torch.cat(moments, dim=1))[:, 0]
        T = torch.eye(4).to(source).repeat(len(source), 1, 1)
        T[:, 0, 0], T[:, 0, 1], T[:, 1, 0], T[:, 1, 1] = angle.cos(), -angle.sin(), angle.sin(), angle.cos()
        return Alignment(T, iterations=options.get("iterations", 1), confidence=-angle.abs())


class ToyPairTraining(PairTrainable):
    """Learns from the true rotation."""

    name = "toy_pair"
    supervision = "supervised"

    def configuration(self):
        return {"width": 4}

    def network(self):
        return ToyNetwork(**self.configuration())

    def losses(self, network, batch, progress):
        T = network.align(batch["source"], batch["target"]).T_target_source
        return {"pose": (T - batch["T_target_source"]).square().mean()}


class ToyPair(PairRegistrar):
    """Answers what the network says."""

    name = "toy_pair"
    files: ClassVar[WeightFiles] = WeightFiles("toy_pair", Path("nowhere"))

    def __init__(self, *, weights="default", init="centroid", max_points=2048, iterations=3):
        self.weights = weights
        self.init = init
        self.max_points = max_points
        self.iterations = iterations

    def build(self, configuration):
        return ToyNetwork(**configuration)

    def options(self):
        return {"iterations": self.iterations}
