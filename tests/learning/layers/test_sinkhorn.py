import pytest
import torch

from regbench.learning.layers.sinkhorn import log_sinkhorn


def random_scores(size=1.0, shape=(3, 7, 9), seed=0):
    return size * torch.randn(*shape, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)


def naive(scores, iterations, slack):
    """RPM-Net's form in numbers, not logarithms."""
    P = torch.nn.functional.pad(scores.exp(), (0, 1, 0, 1), value=1.0) if slack else scores.exp()
    real = slice(None, -1) if slack else slice(None)
    for _ in range(iterations):
        P[:, real] = P[:, real] / P[:, real].sum(dim=2, keepdim=True)
        P[:, :, real] = P[:, :, real] / P[:, :, real].sum(dim=1, keepdim=True)
    return P[:, real, real]


def naive_in_log_space(scores, iterations):
    """RPM-Net's code, its own words."""
    P = torch.nn.functional.pad(scores, (0, 1, 0, 1))
    for _ in range(iterations):
        P = torch.cat([P[:, :-1] - P[:, :-1].logsumexp(dim=2, keepdim=True), P[:, -1:]], dim=1)
        P = torch.cat([P[:, :, :-1] - P[:, :, :-1].logsumexp(dim=1, keepdim=True), P[:, :, -1:]], dim=2)
    return P[:, :-1, :-1]


@pytest.mark.parametrize(("dtype", "tolerance"), [(torch.float32, 1e-5), (torch.float64, 1e-12)])
@pytest.mark.parametrize("slack", [True, False])
@pytest.mark.parametrize("iterations", [1, 2, 5, 6, 23])
@pytest.mark.parametrize("shape", [(3, 7, 9), (2, 9, 4), (1, 1, 1)])
def test_it_is_the_naive_form(dtype, tolerance, slack, iterations, shape):
    scores = random_scores(3, shape)
    found = log_sinkhorn(scores.to(dtype), iterations, slack=slack)
    assert found.dtype == dtype
    torch.testing.assert_close(found.double().exp(), naive(scores, iterations, slack), rtol=0, atol=tolerance)


@pytest.mark.parametrize(("dtype", "tolerance"), [(torch.float32, 3e-6), (torch.float64, 1e-13)])
@pytest.mark.parametrize("size", [30, 300, 1e4])
@pytest.mark.parametrize("offset", [-1, 0, 1])
@pytest.mark.parametrize("iterations", [5, 40])
def test_large_scores_are_as_in_log_space(dtype, tolerance, size, offset, iterations):
    scores = (random_scores(size, (2, 40, 50)) + offset * size).to(dtype)
    found = log_sinkhorn(scores, iterations)
    expected = naive_in_log_space(scores.double(), iterations)
    torch.testing.assert_close(found.double(), expected, rtol=0, atol=tolerance * size)


@pytest.mark.parametrize("slack", [True, False])
@pytest.mark.parametrize("size", [0.0, 1e4])
def test_many_rows_that_want_one_column_stay_finite(slack, size):
    scores = torch.zeros(1, 300, 300)
    scores[:, :, 0] = size
    scores.requires_grad_()
    found = log_sinkhorn(scores, 60, slack=slack)
    found.exp().sum().backward()
    assert torch.isfinite(found).all()
    assert torch.isfinite(scores.grad).all()


def test_without_slack_a_square_becomes_doubly_stochastic():
    P = log_sinkhorn(random_scores(2, (3, 8, 8)), 300, slack=False).exp()
    for axis in (1, 2):
        torch.testing.assert_close(P.sum(dim=axis), torch.ones(3, 8, dtype=P.dtype), rtol=0, atol=1e-10)


def test_with_slack_rows_and_columns_sum_to_less_than_one():
    P = log_sinkhorn(random_scores(2), 300).exp()
    assert P.sum(dim=1).max() < 1
    assert P.sum(dim=2).max() < 1


def test_points_without_a_match_go_to_the_slack():
    scores = torch.full((1, 4, 4), -20.0)
    scores[0, :3, :3] = 20 * torch.eye(3) - 20 * (1 - torch.eye(3))
    P = log_sinkhorn(scores, 5).exp()[0]
    matched = torch.diag(torch.tensor([1.0, 1, 1, 0]))
    assert P[matched > 0].min() > 0.8
    assert P[matched == 0].max() < 1e-7


@pytest.mark.parametrize("slack", [True, False])
def test_permuted_points_have_the_permuted_assignment(slack):
    scores = random_scores(3)
    rows, columns = torch.randperm(7), torch.randperm(9)
    permuted = log_sinkhorn(scores[:, rows][:, :, columns], 8, slack=slack)
    torch.testing.assert_close(permuted, log_sinkhorn(scores, 8, slack=slack)[:, rows][:, :, columns])


@pytest.mark.parametrize("slack", [True, False])
def test_its_gradients_are_those_of_finite_differences(slack):
    scores = random_scores(2, (2, 3, 4)).requires_grad_()
    assert torch.autograd.gradcheck(lambda s: log_sinkhorn(s, 7, slack=slack), scores)


@pytest.mark.parametrize(("shape", "iterations"), [((3, 4), 5), ((1, 3, 4), 0)])
def test_bad_arguments_are_refused(shape, iterations):
    with pytest.raises(ValueError, match="log_sinkhorn needs"):
        log_sinkhorn(torch.zeros(shape), iterations)
