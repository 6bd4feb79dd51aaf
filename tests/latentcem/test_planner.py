import pytest
import torch

from regbench_latentcem.planner import generators_of, plan

ZERO, ONE = torch.zeros(1, 6), torch.ones(1, 6)


def run(reward, mean=ZERO, deviation=ONE, *, T=10, N=1000, K=25, seeds=(0,)):
    return plan(reward, mean, deviation, iterations=T, candidates=N, elites=K, generators=generators_of(seeds))


def test_it_finds_the_optimum_of_a_quadratic():
    optimum = torch.tensor([0.7, -0.3, 0.1, 0.5, -0.5, 0.2])
    found = run(lambda a: -((a - optimum) ** 2).sum(dim=2))
    torch.testing.assert_close(found.actions[0], optimum, rtol=0, atol=1e-3)


def test_it_finds_the_optimum_of_a_function_of_absolute_values_and_other_scales():
    optimum = torch.tensor([0.7, -0.3, 0.1, 0.5, -0.5, 0.2])
    scales = torch.tensor([1.0, 3, 0.5, 2, 1, 1])
    found = run(lambda a: -((a - optimum).abs() * scales).sum(dim=2), T=20)
    torch.testing.assert_close(found.actions[0], optimum, rtol=0, atol=1e-3)


def test_it_finds_the_higher_of_two_hills():
    high, low = torch.full((6,), 0.8), torch.full((6,), -0.8)

    def hills(a):
        return (-((a - high) ** 2).sum(dim=2)).exp() + 0.5 * (-((a - low) ** 2).sum(dim=2)).exp()

    torch.testing.assert_close(run(hills).actions[0], high, rtol=0, atol=2e-3)


def test_elites_mean_and_deviation_by_hand():
    """Of four candidates of which 1, 5 and 3 have the highest rewards: mean 3, variance (4 + 4 + 0) / 3."""
    drawn = []

    def reward(actions):
        drawn.append(actions.clone())
        actions[0, :, :] = torch.tensor([1.0, 9.0, 5.0, 3.0])[:, None]  # so that the elites are known
        return torch.tensor([[8.0, 1.0, 9.0, 7.0]])

    found = run(reward, T=1, N=4, K=3)
    assert found.elites[0, 0, :, 0].tolist() == [5, 1, 3]  # best first
    torch.testing.assert_close(found.means[1], torch.full((1, 6), 3.0))
    torch.testing.assert_close(found.deviations[1], torch.full((1, 6), (8 / 3) ** 0.5))


def test_candidates_follow_the_given_mean_and_deviation():
    mean = torch.tensor([[0.0, 1, 2, 3, 4, 5]])
    deviation = torch.tensor([[1.0, 2, 3, 0.1, 0.2, 0]])
    seen = []

    def reward(actions):
        seen.append(actions)
        return actions[:, :, 0]

    run(reward, mean, deviation, T=1, N=20_000)
    torch.testing.assert_close(seen[0][0].mean(dim=0), mean[0], rtol=0, atol=0.08)
    torch.testing.assert_close(seen[0][0].std(dim=0), deviation[0], rtol=0.03, atol=0)


def test_the_next_candidates_follow_the_elites():
    """One elite: the mean jumps onto it, the deviation is zero, and every later candidate is it."""
    seen = []

    def reward(actions):
        seen.append(actions)
        return -actions.square().sum(dim=2)

    found = run(reward, T=2, K=1)
    best = seen[0][0][reward(seen[0]).argmax()]
    assert torch.equal(found.means[1][0], best)
    assert torch.equal(seen[1][0], best.expand(1000, 6))


def test_candidates_are_kept_when_asked_for_and_change_nothing():
    seen = []

    def reward(actions):
        seen.append(actions)
        return -actions.square().sum(dim=2)

    found = plan(
        reward, ZERO, ONE, iterations=3, candidates=50, elites=5, generators=generators_of([0]), keep_candidates=True
    )
    assert torch.equal(found.candidates, torch.stack(seen))
    without = run(reward, T=3, N=50, K=5)
    assert without.candidates is None
    assert torch.equal(without.means, found.means)


def test_no_iteration_answers_the_starting_mean():
    found = run(lambda a: a[:, :, 0], ONE, T=0)
    assert torch.equal(found.actions, ONE)
    assert found.elites.shape == (0, 1, 25, 6)


def test_the_same_seed_gives_the_same_bits_and_another_seed_others():
    def reward(a):
        return -(a - 0.3).square().sum(dim=2)

    assert torch.equal(run(reward).means, run(reward).means)
    assert not torch.equal(run(reward).actions, run(reward, seeds=(1,)).actions)
    state = torch.get_rng_state()
    run(reward)
    assert torch.equal(torch.get_rng_state(), state)


def test_a_batch_equals_singles():
    optima = torch.tensor([[0.1] * 6, [-0.4] * 6, [0.9] * 6])
    means = torch.tensor([[0.0] * 6, [0.5] * 6, [-0.5] * 6])

    def reward_of(optima):
        return lambda a: -((a - optima[:, None]) ** 2).sum(dim=2)

    batch = run(reward_of(optima), means, torch.ones(3, 6), seeds=(4, 5, 6))
    for p in range(3):
        single = run(reward_of(optima[p : p + 1]), means[p : p + 1], seeds=(4 + p,))
        assert torch.equal(single.means[:, 0], batch.means[:, p])
        assert torch.equal(single.elites[:, 0], batch.elites[:, p])


def test_rewards_that_are_not_finite_are_refused():
    with pytest.raises(ValueError, match="rewards are not finite"):
        run(lambda a: a[:, :, 0] / 0)


@pytest.mark.parametrize(("T", "N", "K"), [(-1, 10, 5), (1, 10, 11), (1, 10, 0)])
def test_numbers_that_do_not_fit_are_refused(T, N, K):
    with pytest.raises(ValueError, match=f"K={K}, N={N}, T={T}"):
        run(lambda a: a[:, :, 0], T=T, N=N, K=K)
