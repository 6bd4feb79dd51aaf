import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from regbench.geometry.kabsch import kabsch
from regbench.learning.layers.weighted_kabsch import rotation_of_covariance, weighted_kabsch

TYPES = [(torch.float32, 3e-6), (torch.float64, 1e-12)]


def case(clouds=4, points=30, seed=0):
    rng = np.random.default_rng(seed)
    return rng.normal(size=(clouds, points, 3)), rng.normal(size=(clouds, points, 3)), rng.random((clouds, points))


def covariances(singular, seed=0):
    """Matrices U diag(singular) V^T with random rotations U and V: the last value's sign is that of the determinant."""
    U, V = (torch.from_numpy(Rotation.random(len(singular), rng=seed + i).as_matrix()) for i in (0, 1))
    return U * torch.tensor(singular, dtype=torch.float64)[:, None, :] @ V.transpose(1, 2)


def assert_rotations(R, tolerance):
    assert torch.isfinite(R).all()
    eye = torch.eye(3, dtype=R.dtype).expand_as(R)
    torch.testing.assert_close(R @ R.transpose(1, 2), eye, rtol=0, atol=tolerance)
    torch.testing.assert_close(torch.linalg.det(R), torch.ones_like(R[:, 0, 0]), rtol=0, atol=tolerance)


@pytest.mark.parametrize(("dtype", "tolerance"), TYPES)
@pytest.mark.parametrize("weighted", [True, False])
@pytest.mark.parametrize("points", [1, 2, 3, 30])
def test_it_is_the_frameworks_kabsch_also_for_clouds_that_match_nowhere(dtype, tolerance, weighted, points):
    source, target, weights = case(points=points)
    target[1] = source[1] * [1, 1, -1]  # the best orthogonal matrix is a reflection
    arrays = [torch.from_numpy(array).to(dtype) for array in (source, target, weights)]
    found = weighted_kabsch(*arrays) if weighted else weighted_kabsch(*arrays[:2])
    assert_rotations(found[:, :3, :3], 4 * tolerance)
    assert found[:, 3].tolist() == [[0, 0, 0, 1]] * 4
    for T, X, Y, w in zip(found.double().numpy(), source, target, weights, strict=True):
        w = w if weighted else np.ones(points)
        best = kabsch(X, Y, w)
        if points > 2:
            np.testing.assert_allclose(T, best, rtol=0, atol=30 * tolerance)
        # Two points leave a turn about their line free: as good, not the same.
        costs = [w @ ((X @ motion[:3, :3].T + motion[:3, 3] - Y) ** 2).sum(axis=1) for motion in (T, best)]
        assert costs[0] == pytest.approx(costs[1], abs=100 * tolerance)


def test_its_rotation_is_scipys():
    source, target, weights = case()
    found = weighted_kabsch(*map(torch.from_numpy, (source, target, weights)))
    for T, X, Y, w in zip(found.numpy(), source, target, weights, strict=True):
        centred = [points - np.average(points, axis=0, weights=w) for points in (X, Y)]
        expected, _ = Rotation.align_vectors(centred[1], centred[0], weights=w)
        np.testing.assert_allclose(T[:3, :3], expected.as_matrix(), rtol=0, atol=1e-12)


@pytest.mark.parametrize(("dtype", "tolerance"), TYPES)
def test_it_finds_a_motion_far_from_the_origin_and_of_any_sum_of_weights(dtype, tolerance):
    source, _, weights = (torch.from_numpy(array).to(dtype) for array in case())
    R = torch.from_numpy(Rotation.random(4, rng=1).as_matrix()).to(dtype)
    source = source + 100
    target = source @ R.transpose(1, 2) + 7
    for scale in (1e-6, 1.0, 1e6):
        T = weighted_kabsch(source, target, scale * weights)
        torch.testing.assert_close(T[:, :3, :3], R, rtol=0, atol=100 * tolerance)
        moved = source @ T[:, :3, :3].transpose(1, 2) + T[:, None, :3, 3]
        torch.testing.assert_close(moved, target, rtol=0, atol=300 * tolerance)


def test_points_without_weight_are_ignored():
    source, target, weights = map(torch.from_numpy, case())
    weights[:, 10:] = 0
    few = weighted_kabsch(source[:, :10], target[:, :10], weights[:, :10])
    torch.testing.assert_close(weighted_kabsch(source, target, weights), few, rtol=0, atol=1e-12)


@pytest.mark.parametrize("mirrored", [False, True])
def test_its_gradients_are_those_of_finite_differences(mirrored):
    source, target, weights = map(torch.from_numpy, case(clouds=2, points=6))
    if mirrored:
        target = source * torch.tensor([1.0, 1.0, -1.0]) + 0.1 * target
    inputs = [tensor.requires_grad_() for tensor in (source, target, weights)]
    assert torch.autograd.gradcheck(weighted_kabsch, inputs)
    assert torch.autograd.gradcheck(weighted_kabsch, inputs[:2])


@pytest.mark.parametrize(
    "singular",
    [(3, 2, 1), (3, 2, -1), (3, 2, 0), (2, 2, 2), (2, 1, 1), (2, 2, 1), (2, 2, -1), (2, 2, 0), (1e-6, 1e-6, 1e-6)],
)
def test_the_rotations_gradient_is_right_wherever_there_is_one(singular):
    """Equal singular values and a plane are no exception: only s2 + d s3 = 0 is one."""
    step = 1e-6 * singular[0]
    G = torch.from_numpy(np.random.default_rng(5).normal(size=(1, 3, 3)))
    H = covariances([singular]).requires_grad_()
    (rotation_of_covariance(H) * G).sum().backward()
    for i, j in np.ndindex(3, 3):
        off = torch.zeros(1, 3, 3, dtype=torch.float64)
        off[0, i, j] = step
        up, down = (((rotation_of_covariance(H.detach() + sign * off)) * G).sum() for sign in (1, -1))
        assert float(H.grad[0, i, j]) * singular[0] == pytest.approx(float(up - down) / 2e-6, abs=1e-5)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("scale", [1.0, 1e-15, 1e15, 0.0])
@pytest.mark.parametrize("singular", [(1, 0, 0), (1, 1, -1), (1, 0.5, -0.5), (1, 1e-9, 0), (0, 0, 0), (1, 1, 1)])
def test_a_rotation_that_is_not_unique_has_a_value_and_a_finite_gradient(dtype, scale, singular):
    H = (covariances([singular]) * scale).to(dtype).requires_grad_()
    R = rotation_of_covariance(H)
    assert_rotations(R, 1e-5)
    R.square().mul(torch.arange(9.0, dtype=dtype).view(3, 3)).sum().backward()
    assert torch.isfinite(H.grad).all()


def test_a_turn_that_is_not_determined_has_no_gradient():
    H = torch.diag(torch.tensor([1.0, 0, 0]))[None].requires_grad_()
    R = rotation_of_covariance(H)
    R.backward(R.detach() @ torch.tensor([[0.0, 0, 0], [0, 0, -1], [0, 1, 0]]))  # a turn about the line
    assert H.grad.abs().max() == 0


LINE = torch.linspace(-1, 1, 8)[:, None] * torch.tensor([1.0, 2.0, 3.0])
CUBE = torch.cartesian_prod(*[torch.tensor([-1.0, 1.0])] * 3)
DEGENERATE = {
    "line": (LINE, LINE),
    "line onto its reverse": (LINE, -LINE),
    "plane": (CUBE * torch.tensor([1.0, 1.0, 0.0]), CUBE * torch.tensor([0.0, 1.0, 1.0])),
    "identical": (CUBE, CUBE),
    "inverted": (CUBE, -CUBE),
    "a point": (torch.zeros(8, 3), torch.ones(8, 3)),
    "a point onto a cube": (torch.ones(8, 3), CUBE),
    "huge": (1e6 * CUBE, -1e6 * CUBE),
    "tiny": (1e-12 * CUBE, -1e-12 * CUBE),
}
WEIGHTS = {
    "equal": torch.ones(8),
    "one": torch.eye(8)[2],
    "two": torch.eye(8)[2] + torch.eye(8)[3],
    "none": torch.zeros(8),
    "nearly none": torch.full((8,), 1e-30),
    "denormal": torch.full((8,), 1e-42),
    "huge": torch.full((8,), 1e30),
}


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("weights", WEIGHTS)
@pytest.mark.parametrize("clouds", DEGENERATE)
def test_clouds_that_determine_no_rotation_have_a_motion_and_finite_gradients(clouds, weights, dtype):
    inputs = [tensor[None].to(dtype).requires_grad_() for tensor in (*DEGENERATE[clouds], WEIGHTS[weights])]
    T = weighted_kabsch(*inputs)
    assert_rotations(T[:, :3, :3], 1e-5)
    (T * torch.arange(16, dtype=dtype).view(4, 4)).sum().backward()
    assert all(torch.isfinite(tensor.grad).all() for tensor in inputs)


def test_no_weight_at_all_is_the_identity():
    source, target, weights = map(torch.from_numpy, case())
    assert torch.equal(weighted_kabsch(source, target, 0 * weights), torch.eye(4, dtype=torch.float64).expand(4, 4, 4))
