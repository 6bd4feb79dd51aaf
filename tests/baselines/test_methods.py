"""Every method: conforms, and is as good on real shapes as it has to be."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from regbench import Problem
from regbench.errors import UserError
from regbench.geometry.se3 import rotation_from_euler_deg, se3, transform
from regbench.registry import MethodRegistry, import_file, parse_methods
from regbench.testing import assert_conforms

problems = import_file(Path(__file__).with_name("problems.py"))

METHODS = ["icp", "gicp", "fgr", "ransac", "kiss_icp", "small_gicp"]
OUR_ICP = "icp[backend=numba,init=prior]"
SENTINELS = ["identity", "random", "oracle", "degenerate", "prior_mean"]
VARIANTS = [
    "icp[metric=plane]",
    "icp[backend=numba]",
    "icp[backend=numba,overlap=0.8]",
    "small_gicp[registration_type=VGICP]",
]


def resolved(text):
    return MethodRegistry().resolve(parse_methods([text])[0])


def build(text):
    method = resolved(text)
    return method.cls(**method.parameters)


@pytest.mark.parametrize("text", METHODS + SENTINELS + VARIANTS)
def test_conforms(text):
    method = resolved(text)
    assert_conforms(method.cls, method.parameters)


def answers(text, pairs):
    method = build(text)
    return [(method.register(problem).T_target_source, truth) for problem, truth in pairs]


def rotation_errors(text, pairs):
    return np.array([problems.rotation_error_deg(T, truth) for T, truth in answers(text, pairs)])


@pytest.fixture(scope="module")
def clean(shared_data):
    return [problems.clean_pair(shape, i) for i, shape in enumerate(problems.modelnet40_shapes(shared_data, 12))]


@pytest.fixture(scope="module")
def noisy(shared_data):
    return [problems.clean_pair(shape, i, True) for i, shape in enumerate(problems.modelnet40_shapes(shared_data, 12))]


def test_our_own_icp_is_open3ds(clean, noisy):
    """The same minimum from the same start: on copies exactly, with noise within 0.05 degrees."""
    for pairs, apart_deg in ((clean, 1e-6), (noisy, 0.05)):
        for (one, _), (other, _) in zip(answers("icp[init=prior]", pairs), answers(OUR_ICP, pairs), strict=True):
            assert problems.rotation_error_deg(one, other) < apart_deg


@pytest.mark.parametrize(
    ("text", "reason"),
    [("icp[backend=numba,metric=plane]", "metric=plane needs backend=open3d"), ("icp[overlap=0.5]", "does not trim")],
)
def test_what_a_backend_does_not_have_is_refused(text, reason):
    with pytest.raises(UserError, match=reason):
        build(text).prepare()


@pytest.mark.parametrize("text", ["fgr", "ransac", "degenerate"])
def test_clean_copies_are_aligned_exactly(text, clean):
    assert rotation_errors(text, clean).max() < 1e-6


@pytest.mark.parametrize("text", ["fgr", "ransac"])
def test_global_methods_with_final_icp_reach_the_noise_floor(text, noisy):
    found = answers(text, noisy)
    assert max(problems.rotation_error_deg(T, truth) for T, truth in found) < 1
    assert max(problems.translation_error(T, truth) for T, truth in found) < 0.01


@pytest.mark.parametrize("text", ["icp", "gicp", "small_gicp", "kiss_icp"])
def test_local_methods_lock_on_to_most_clean_copies(text, clean):
    assert np.median(rotation_errors(text, clean)) < 0.1


def test_the_mean_of_the_prior_is_a_better_start_than_none(clean):
    assert rotation_errors("icp[init=prior]", clean).max() < rotation_errors("icp[preset=paper]", clean).max()


def test_prior_mean_looks_at_no_shape_and_matches_centroids(clean):
    for T, truth in answers("prior_mean", clean):
        np.testing.assert_allclose(T[:3, :3], problems.PRIOR.mean_T_target_source()[:3, :3])
        assert problems.rotation_error_deg(T, truth) < 45
    T, _ = answers("prior_mean", clean)[0]
    problem = clean[0][0]
    np.testing.assert_allclose(
        T[:3, :3] @ problem.source.mean(axis=0) + T[:3, 3], problem.target.mean(axis=0), atol=1e-12
    )


def test_sentinels(clean):
    problem, truth = clean[0]
    np.testing.assert_array_equal(build("identity").register(problem).T_target_source, np.eye(4))
    np.testing.assert_array_equal(build("oracle").register_with_truth(problem, truth).T_target_source, truth)
    with pytest.raises(RuntimeError, match="register_with_truth"):
        build("oracle").register(problem)
    assert build("oracle").warm_up(problem) is None


def test_random_draws_from_all_rotations_by_the_problems_seed(clean):
    from dataclasses import replace

    problem, _ = clean[0]
    draws = [build("random").register(replace(problem, seed=seed)).T_target_source for seed in range(400)]
    # Uniform on SO(3): the angle's density is (1 - cos t) / pi, its mean pi/2 + 2/pi = 126.5 deg.
    assert np.mean([problems.rotation_error_deg(T, np.eye(4)) for T in draws]) == pytest.approx(126.5, abs=6)
    np.testing.assert_array_equal(draws[3], build("random").register(replace(problem, seed=3)).T_target_source)


@pytest.mark.parametrize(
    "text", ["icp[init=prior]", "gicp[init=prior]", "small_gicp[init=prior]", "kiss_icp[init=prior]", "prior_mean"]
)
def test_without_a_prior_what_needs_one_is_skipped_with_a_reason(text, clean):
    from dataclasses import replace

    problem, _ = clean[0]
    method = build(text)
    assert method.skip(problem) is None
    assert "motion prior" in method.skip(replace(problem, motion_prior=None))
    with pytest.raises(ValueError, match="motion prior"):
        method.register(replace(problem, motion_prior=None))


@pytest.mark.parametrize("text", ["icp", "gicp", "small_gicp", "kiss_icp", "icp[preset=paper]"])
def test_a_start_given_by_the_problem_is_used(text, clean):
    from dataclasses import replace

    method = build(text)
    for problem, truth in clean[:6]:
        T = method.register(replace(problem, init_T_target_source=truth)).T_target_source
        assert problems.rotation_error_deg(T, truth) < 0.1
        assert problems.translation_error(T, truth) < 1e-3


def test_an_icp_of_no_iterations_answers_its_start(clean):
    problem, _ = clean[0]
    for init, expected in (
        ("identity", np.eye(4)),
        ("prior", answers("prior_mean", clean[:1])[0][0]),
    ):
        T = build(f"icp[init={init},max_iterations=0]").register(problem).T_target_source
        np.testing.assert_allclose(T, expected, atol=1e-12)


def test_refusals_name_the_cloud():
    from regbench import Problem

    few, enough = np.eye(3)[[0, 0, 0, 1, 1]], np.random.default_rng(0).normal(size=(50, 3))
    for text in ("fgr", "ransac", "gicp", "small_gicp", "icp[metric=plane]"):
        with pytest.raises(ValueError, match="the source cloud has fewer than 3 distinct points"):
            build(text).register(Problem(source=few, target=enough))
        with pytest.raises(ValueError, match="the target cloud has fewer than 3 distinct points"):
            build(text).register(Problem(source=enough, target=few))
    for text in ("icp", "kiss_icp", "degenerate"):
        with pytest.raises(ValueError, match=r"has no points"):
            build(text).register(Problem(source=np.empty((0, 3)), target=enough))


@pytest.mark.parametrize("text", ["icp", "kiss_icp", "small_gicp", "gicp", "fgr"])
def test_three_points_get_a_rigid_motion_or_a_reason(text):
    from regbench import Problem
    from regbench.geometry.se3 import why_not_rigid

    problem = Problem(source=np.eye(3), target=np.eye(3) + 0.1)
    assert why_not_rigid(build(text).register(problem).T_target_source) is None


def test_real_depth_frames_end_closer_than_they_began(shared_data):
    from PIL import Image

    from regbench import Problem

    folder = shared_data / "7scenes" / "redkitchen" / "seq-01"
    clouds, poses = [], []
    for number in (0, 10):
        depth = np.asarray(Image.open(folder / f"frame-{number:06d}.depth.png")).astype(float)
        v, u = np.nonzero((depth > 0) & (depth < 65535))
        z = depth[v, u] / 1000
        cloud = np.column_stack([(u - 320) * z / 585, (v - 240) * z / 585, z])
        clouds.append(np.random.default_rng(number).permutation(cloud)[:5000])
        poses.append(np.loadtxt(folder / f"frame-{number:06d}.pose.txt"))
    truth = np.linalg.inv(poses[1]) @ poses[0]
    problem = Problem(source=clouds[0], target=clouds[1])
    began = problems.rotation_error_deg(np.eye(4), truth)
    for text in ("small_gicp", "kiss_icp", "fgr"):
        ended = problems.rotation_error_deg(build(text).register(problem).T_target_source, truth)
        assert ended < 0.6 * began, text


@pytest.mark.parametrize("text", ["fgr", "ransac", "icp", "gicp", "kiss_icp", "small_gicp"])
def test_pinned_to_one_core_two_processes_give_the_same_bits(text):
    code = f"""
import os, sys; os.sched_setaffinity(0, {{min(os.sched_getaffinity(0))}})
import numpy as np
from regbench.registry import MethodRegistry, parse_methods
from regbench.testing.clouds import body, make_problem
method = MethodRegistry().resolve(parse_methods([{text!r}])[0])
rng = np.random.default_rng(0)
problem = make_problem(body(784) + rng.normal(0, .01, (784, 3)), body(700, seed=1))
sys.stdout.write('\\n' + method.cls(**method.parameters).register(problem).T_target_source.tobytes().hex())
"""
    runs = [
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()[-1]
        for _ in range(2)
    ]
    assert runs[0] == runs[1]


@pytest.mark.parametrize("text", ["fgr", "ransac"])
def test_large_clouds_are_thinned_and_still_aligned(text):
    from regbench.geometry.se3 import transform
    from regbench.testing.clouds import EASY_T_TARGET_SOURCE, body, make_problem

    problem = make_problem(body(100_000), transform(EASY_T_TARGET_SOURCE, body(60_000, seed=1)))
    T = build(text).register(problem).T_target_source
    assert problems.rotation_error_deg(T, EASY_T_TARGET_SOURCE) < 1
    assert problems.translation_error(T, EASY_T_TARGET_SOURCE) < 0.01


@pytest.mark.parametrize("text", METHODS)
def test_odd_clouds_get_a_rigid_motion(text):
    from regbench import Problem
    from regbench.geometry.se3 import why_not_rigid

    rng = np.random.default_rng(0)
    cloud = rng.normal(size=(300, 3))
    odd = {
        "every point twice": np.repeat(cloud, 2, axis=0),
        "far smaller than the target": rng.normal(size=(6000, 3)) * 1e-4,
        "far from the target": cloud + 1e6,
    }
    for what, source in odd.items():
        for problem in (Problem(source=source, target=cloud), Problem(source=cloud, target=source)):
            assert why_not_rigid(build(text).register(problem).T_target_source) is None, what


@pytest.mark.parametrize("method", ["fgr", "ransac"])
def test_flat_clouds_are_aligned_though_their_features_say_nothing(method):
    rng = np.random.default_rng(3)
    flat = np.column_stack([rng.uniform(-1, 1, 500) ** 3, rng.uniform(-0.6, 0.9, 500), np.zeros(500)])
    T = se3(rotation_from_euler_deg([40, 30, 20]), [0.3, -0.2, 0.1])
    problem = Problem(source=flat, target=transform(T, flat)[rng.permutation(500)])
    answer = build(method).register(problem)
    np.testing.assert_allclose(answer.T_target_source, T, atol=1e-6)
