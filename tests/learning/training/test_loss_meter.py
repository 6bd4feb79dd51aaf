import pytest
import torch

from regbench.errors import UserError
from regbench.learning.training.loss_meter import LossMeter


def same(values):
    return values


def scalars(**terms):
    return {name: torch.tensor(float(value)) for name, value in terms.items()}


def test_averages_are_by_term_and_the_total_is_of_the_sums():
    meter = LossMeter()
    assert float(meter.add(1, scalars(a=1, b=10))) == 11
    assert float(meter.add(2, scalars(a=3))) == 3
    assert meter.flush(same) == {"a": 2.0, "b": 10.0, "total": 7.0}
    assert meter.flush(same) == {}


def test_the_sum_carries_the_gradient_and_the_memory_does_not():
    meter, weight = LossMeter(), torch.ones((), requires_grad=True)
    (gradient,) = torch.autograd.grad(meter.add(1, {"a": 2 * weight, "b": (3 * weight).reshape(1)}), weight)
    assert gradient == 5
    assert not any(value.requires_grad for value in meter._values)


def test_the_mean_over_processes_is_asked_for_once():
    meter = LossMeter()
    for step in range(1, 4):
        meter.add(step, scalars(a=step, b=0))
    calls = []
    assert meter.flush(lambda values: calls.append(values.shape) or values * 2)["a"] == 4.0
    assert calls == [(6,)]


@pytest.mark.parametrize("value", ["nan", "inf", "-inf"])
def test_the_first_term_that_is_not_finite_is_named(value):
    meter = LossMeter()
    meter.add(7, scalars(a=1, b=2))
    meter.add(8, scalars(a=1, b=value))
    meter.add(9, scalars(a=value, b=value))
    with pytest.raises(UserError, match=f"the loss term 'b' is {value} at step 8"):
        meter.flush(same)
