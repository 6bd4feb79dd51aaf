import math

import pytest

from regbench.learning.training.recipe import Training
from regbench.learning.training.schedule import average_decay_at, learning_rate_at


def rates(**training):
    recipe = Training(**{"steps": 11, "learning_rate": 2.0} | training)
    return [learning_rate_at(recipe, step) for step in range(recipe.steps)]


def test_cosine_falls_from_the_highest_to_the_final_rate():
    found = rates(final_learning_rate=0.1)
    assert found[0] == 2.0
    assert math.isclose(found[-1], 0.2)
    assert math.isclose(found[5], (2.0 + 0.2) / 2), "half-way in steps is half-way in rate"
    assert found == sorted(found, reverse=True)


def test_warm_up_rises_linearly_and_never_starts_at_zero():
    found = rates(warm_up_steps=4)
    assert found[:5] == [0.5, 1.0, 1.5, 2.0, 2.0]
    assert math.isclose(found[-1], 0.0, abs_tol=1e-12)


def test_constant_stays():
    assert rates(schedule="constant", warm_up_steps=2) == [1.0] + [2.0] * 10


@pytest.mark.parametrize("steps", [1, 2, 3])
def test_very_short_trainings_have_finite_positive_first_rates(steps):
    for warm_up in range(4):
        found = rates(steps=steps, warm_up_steps=warm_up)
        assert all(0 <= rate <= 2 for rate in found)
        assert found[0] > 0


def test_the_average_forgets_the_start():
    recipe = Training(average=0.999)
    assert average_decay_at(recipe, 1) == 2 / 11
    assert average_decay_at(recipe, 100_000) == 0.999
    assert average_decay_at(Training(average=0.5), 100) == 0.5
