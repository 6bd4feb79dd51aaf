import numpy as np
import pytest
import torch
from scipy.linalg import expm

from regbench.learning.layers.se3_exponential import SERIES_BELOW, se3_exp

EDGE = SERIES_BELOW**0.5
ANGLES = [0.0, 1e-160, 1e-20, 1e-8, 1e-4, 0.01, EDGE - 1e-9, EDGE + 1e-9, 1.0, np.pi, 7.0]


def twists_of(angle, length=1.0):
    twists = np.random.default_rng(0).normal(size=(5, 6))
    twists[:, :3] *= angle / np.linalg.norm(twists[:, :3], axis=1, keepdims=True)
    twists[:, 3:] *= length
    return torch.from_numpy(twists)


def matrix(twist):
    x, y, z, *v = twist
    X = np.zeros((4, 4))
    X[:3, :3] = [[0, -z, y], [z, 0, -x], [-y, x, 0]]
    X[:3, 3] = v
    return X


@pytest.mark.parametrize(("dtype", "tolerance"), [(torch.float32, 1e-6), (torch.float64, 2e-15)])
@pytest.mark.parametrize("length", [1.0, 100.0])
@pytest.mark.parametrize("angle", ANGLES)
def test_it_is_the_matrix_exponential(angle, length, dtype, tolerance):
    twists = twists_of(angle, length).to(dtype)
    found = se3_exp(twists).double().numpy()
    expected = np.stack([expm(matrix(twist)) for twist in twists.double().numpy()])
    # SciPy scales the whole matrix: its rotation of long twists is less exact than its rotation of short ones.
    rotations = [
        expm(matrix(twist))[:3, :3] for twist in (twists / twists.new([1] * 3 + [length] * 3)).double().numpy()
    ]
    np.testing.assert_allclose(found[:, :3, :3], rotations, rtol=0, atol=2 * tolerance * max(1, angle))
    np.testing.assert_allclose(
        found[:, :3, 3], expected[:, :3, 3], rtol=0, atol=10 * length * tolerance * max(1, angle)
    )
    assert (found[:, 3] == [0, 0, 0, 1]).all()


def test_rotation_comes_first_then_translation():
    turn, step = se3_exp(torch.tensor([[0, 0, np.pi / 2, 0, 0, 0], [0, 0, 0, 1.0, 2, 3]])).numpy()
    np.testing.assert_allclose(turn[:3, :3] @ [1, 0, 0], [0, 1, 0], atol=1e-6)
    np.testing.assert_allclose(step[:3, 3], [1, 2, 3])


@pytest.mark.parametrize("angle", [0.0, 1e-4, 0.3, 1.0, 3.0])
def test_its_gradients_are_those_of_finite_differences(angle):
    assert torch.autograd.gradcheck(se3_exp, twists_of(angle).requires_grad_())


@pytest.mark.parametrize(("dtype", "tolerance"), [(torch.float32, 1e-5), (torch.float64, 1e-13)])
@pytest.mark.parametrize("angle", ANGLES)
def test_its_gradients_are_exact_at_every_angle(angle, dtype, tolerance):
    """The derivative of the exponential is a block of the exponential of a doubled matrix (Najfeld and Havel 1995)."""
    twists = twists_of(angle)
    found = torch.autograd.functional.jacobian(se3_exp, twists.to(dtype)).double()
    for b, twist in enumerate(twists.to(dtype).double().numpy()):
        for axis in range(6):
            doubled = np.kron(np.eye(2), matrix(twist))
            doubled[:4, 4:] = matrix(np.eye(6)[axis])
            expected = expm(doubled)[:4, 4:]
            np.testing.assert_allclose(found[b, :, :, b, axis], expected, rtol=0, atol=tolerance * max(1, angle) ** 2)


@pytest.mark.parametrize("size", [1e-30, 1e4, 1e10])
def test_gradients_stay_finite_for_twists_of_any_size(size):
    twists = torch.full((1, 6), size, requires_grad=True)
    se3_exp(twists)[:, :3, :3].sum().backward()
    assert torch.isfinite(twists.grad).all()
