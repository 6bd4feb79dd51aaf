import numpy as np
import pytest
import torch

from regbench.learning.training.recipe import Training
from regbench.learning.training.samples import batches
from regbench.learning.training.seeds import sample_generator
from tests.learning.training.toy_training import Toy


def steps(training, **options):
    toy = Toy({}, data=None)
    return [batch["x"] for batch in batches(toy, training, **options)]


def test_sample_i_of_step_s_depends_on_seed_s_and_i_alone():
    training = Training(steps=5, batch=4, seed=3)
    found = steps(training)
    assert [tuple(x.shape) for x in found] == [(4, 3)] * 5
    for step, x in enumerate(found):
        for index in range(4):
            expected = Toy({}, data=None).sample(sample_generator(3, step, index), step / 5)["x"]
            np.testing.assert_array_equal(x[index].numpy(), expected)
    assert len(torch.cat(found).unique(dim=0)) == 20, "no sample comes twice"


@pytest.mark.filterwarnings("ignore:This DataLoader will create 2 worker processes")
def test_worker_processes_do_not_change_samples_or_their_order():
    here, there = (steps(Training(steps=6, batch=3, loader_workers=workers)) for workers in (0, 2))
    assert all(torch.equal(a, b) for a, b in zip(here, there, strict=True))


def test_a_continued_training_gets_the_remaining_steps():
    training = Training(steps=6, batch=3)
    assert all(torch.equal(a, b) for a, b in zip(steps(training)[4:], steps(training, first=4), strict=True))


def test_processes_share_a_batch_without_overlap():
    training = Training(steps=3, batch=6)
    parts = [steps(training, rank=rank, processes=2) for rank in range(2)]
    for whole, first, second in zip(steps(training), *parts, strict=True):
        assert torch.equal(whole[0::2], first)
        assert torch.equal(whole[1::2], second)


def test_more_steps_leave_earlier_draws_as_they_were():
    a, b = (sample_generator(0, 7, 2).normal(size=4) for _ in range(2))
    np.testing.assert_array_equal(a, b)
    assert not np.array_equal(a, sample_generator(0, 2, 7).normal(size=4))
    assert not np.array_equal(a, sample_generator(1, 7, 2).normal(size=4))
