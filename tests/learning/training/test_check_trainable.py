import numpy as np
import pytest
import torch

from regbench.learning.training.check_trainable import check_trainable
from tests.learning.training.toy_training import Toy


def problems(**attributes):
    return check_trainable(type("Changed", (Toy,), attributes)({}, data=None))


def test_the_toy_keeps_its_promises():
    assert problems() == []


def drawing_elsewhere(self, rng, progress):
    return {"x": np.random.default_rng().normal(size=3).astype(np.float32), "y": np.zeros(2, np.float32)}


def never_drawing(self, rng, progress):
    return {"x": np.zeros(3, np.float32), "y": np.zeros(2, np.float32)}


def of_the_last_layer(self, network, batch, progress):
    return {"last": network[-1].weight.square().sum()}


def counting(self, network):
    self.count = getattr(self, "count", 0) + 1
    return {"error": self.count}


@pytest.mark.parametrize(
    ("attributes", "words"),
    [
        ({"sample": drawing_elsewhere}, "sample: 'x' differs for the same generator"),
        ({"sample": never_drawing}, "sample: does not depend on its generator"),
        ({"losses": of_the_last_layer}, "losses: no gradient reaches the weight '0.weight' (5 such)"),
        ({"losses": lambda self, n, b, p: {"a": n(b["x"])}}, "losses: UserError: losses(): the term 'a' is of shape"),
        ({"losses": lambda self, n, b, p: {"a": n(b["x"]).sum() / 0}}, "losses: their sum is"),
        (
            {"losses": lambda self, n, b, p: {"a": n(b["x"]).sum() + next(self.c)}, "c": iter(range(9))},
            "losses: differ",
        ),
        ({"monitor": "eror"}, "validate: gives no 'eror'"),
        ({"validate": counting}, "validate: figures differ for the same weights"),
        ({"load": lambda self, network, weights: None}, "load: the figures of the validation change"),
        ({"card": lambda self: {"when": torch.zeros(2)}}, "card: Object of type Tensor is not JSON serializable"),
        ({"card": lambda self: {1: 2}}, "card: does not come back from JSON"),
    ],
)
def test_each_broken_promise_is_named(attributes, words):
    found = problems(**attributes)
    assert any(line.startswith(words) for line in found), found
