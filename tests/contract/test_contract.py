import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import regbench
from regbench import MotionPrior, Problem, Registrar, Registration

POINTS = np.arange(12.0).reshape(4, 3)


def test_a_problem_keeps_read_only_copies():
    given = POINTS.copy()
    problem = Problem(source=given, target=given, init_T_target_source=np.eye(4))
    given[:] = 0
    np.testing.assert_array_equal(problem.source, POINTS)
    for array in (problem.source, problem.target, problem.init_T_target_source):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1


def test_a_problem_makes_float64_in_rows_of_what_it_gets():
    for given in (POINTS.astype(np.float32), np.asfortranarray(POINTS), POINTS[::1].tolist(), POINTS.astype(int)):
        source = Problem(source=given, target=POINTS).source
        assert source.dtype == np.float64
        assert source.flags.c_contiguous
        np.testing.assert_array_equal(source, POINTS)


def test_a_problem_is_frozen():
    problem = Problem(source=POINTS, target=POINTS)
    with pytest.raises(AttributeError):
        problem.seed = 3


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"source": POINTS[:, :2]}, r"source must have shape \(N, 3\), got \(4, 2\)"),
        ({"target": POINTS[0]}, r"target must have shape \(N, 3\), got \(3,\)"),
        ({"target": POINTS * np.nan}, "target has values that are not finite"),
        ({"source_normals": POINTS[:2]}, "source_normals must have one row per point of source"),
        ({"target_normals": POINTS * np.inf}, "target_normals has values that are not finite"),
        ({"init_T_target_source": np.eye(3)}, r"finite \(4, 4\) matrix"),
        ({"init_T_target_source": np.eye(4) * np.nan}, r"finite \(4, 4\) matrix"),
    ],
)
@pytest.mark.filterwarnings("ignore:invalid value")
def test_a_problem_refuses_what_is_no_cloud_and_names_it(arguments, words):
    with pytest.raises(ValueError, match=words):
        Problem(**({"source": POINTS, "target": POINTS} | arguments))


def test_the_mean_motion_is_the_middle_of_every_range():
    prior = MotionPrior((0, 10, -20), (45, 30, 20), (-1, 0, 2), (1, 1, 4))
    mean = prior.mean_T_target_source()
    expected = Rotation.from_euler("zyx", (0, 20, 22.5), degrees=True).as_matrix()
    np.testing.assert_allclose(mean[:3, :3], expected, atol=1e-15)
    np.testing.assert_allclose(mean[:3, 3], (0, 0.5, 3))


class Method(Registrar):
    name = "method"

    def __init__(self, *, distance: float = 0.5, label: str | None = None) -> None:
        self.distance = distance
        self.label = label

    def register(self, problem):
        self.registered = problem
        return Registration(T_target_source=np.eye(4))


def test_a_registrar_has_defaults_for_everything_but_register():
    method = Method(distance=2.0)
    problem = Problem(source=POINTS, target=POINTS)
    assert repr(method) == "Method(distance=2.0, label=None)"
    assert method.skip(problem) is None
    method.prepare()
    method.warm_up(problem)
    assert method.registered is problem
    assert (method.version, method.kind, method.deterministic, method.sees_ground_truth) == (
        "1",
        "classical",
        True,
        False,
    )
    with pytest.raises(NotImplementedError):
        Registrar().register(problem)


def test_importing_regbench_loads_no_numpy():
    import subprocess
    import sys

    code = "import regbench, sys; print('numpy' in sys.modules); regbench.Problem; print('numpy' in sys.modules)"
    printed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert printed == ["False", "True"]
    with pytest.raises(AttributeError, match="no attribute 'Nothing'"):
        regbench.Nothing  # noqa: B018
