"""Go-ICP: bounds that hold, certificates that are true, and the right answer where ICP alone ends elsewhere."""

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from regbench_baselines.goicp.bounds import exact_squared_error_bound, rotate, squared_error, squared_error_bound
from regbench_baselines.goicp.heap import pop, push
from regbench_baselines.goicp.registrar import GoIcp
from regbench_baselines.goicp.rotation_cells import cell_angle, rotation_at
from regbench_baselines.goicp.search import Box, Settings, mean_squared_error, search
from regbench_baselines.goicp.space import Space, empty_heap
from regbench_baselines.goicp.translation_search import least_over_translations
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from regbench.contract import MotionPrior
from regbench.geometry.distance_grid import DistanceGrid
from regbench.geometry.icp import icp
from regbench.geometry.nearest_tree import build_tree
from regbench.geometry.se3 import rotation_from_euler_deg, se3, transform, why_not_rigid
from regbench.metrics.rotation import rotation_error_deg
from regbench.registry import MethodRegistry, parse_methods
from regbench.testing import assert_conforms
from regbench.testing.clouds import body, make_problem

SETTINGS = {
    "threshold": 1e-3,
    "overlap": 1.0,
    "euler_rad": None,
    "translation": None,
    "cells": 48,
    "beam": 300,
    "starts": 32,
    "finalists": 4,
    "max_points": 1000,
    "max_nodes": None,
    "budget_s": None,
}


def turned(cloud, degrees, seed=0, shift=(0.3, 0, -0.2)):
    """A permuted copy of a cloud, moved, and the motion."""
    truth = se3(Rotation.from_rotvec(np.radians(degrees) * np.array([0.6, 0, 0.8])).as_matrix(), np.array(shift))
    return transform(truth, np.random.default_rng(seed).permutation(cloud)), truth


def off_deg(motion, truth):
    return float(rotation_error_deg(motion[None, :3, :3], truth[None, :3, :3])[0])


def shell(seed, count=60):
    """Points on an ellipsoid: a small problem."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(count, 3))
    return points / np.linalg.norm(points, axis=1)[:, None] * rng.uniform(0.3, 1, 3)


def space_of(source, target, *, cells, overlap, place, gap_half):
    """What a search over all rotations and a cube of translations would read."""
    grid = DistanceGrid.of(target, cells=cells).exact()
    tree, order, axes = build_tree(target)
    return Space(
        points=np.ascontiguousarray((source / grid.cell).T, dtype=np.float32),
        reach=np.linalg.norm(source / grid.cell, axis=1).astype(np.float32),
        target=((target - grid.low) / grid.cell).astype(np.float32),
        labels=grid.labels,
        distances=grid.distances / np.float32(grid.cell),
        shape=grid.shape,
        tree=(tree - grid.low) / grid.cell,
        axes=axes,
        places=np.argsort(order),
        kept=int(np.ceil(overlap * len(source))),
        euler=False,
        rotation_centre=np.zeros(3),
        rotation_half=np.full(3, np.pi),
        centre=((place - grid.low) / grid.cell).astype(np.float32),
        half=np.full(3, gap_half / grid.cell),
    )


def test_it_is_installed_under_its_name():
    assert MethodRegistry().resolve(parse_methods(["goicp"])[0]).cls is GoIcp


@pytest.mark.parametrize("parameters", [{}, {"motion": "centred", "overlap": 0.9}])
def test_conforms(parameters):
    assert_conforms(GoIcp, parameters)


def test_the_heap_hands_out_the_least_first():
    rng = np.random.default_rng(0)
    keys = rng.integers(0, 50, 300).astype(float)
    heap, cell = empty_heap(300), np.empty(4, np.float32)
    for size, key in enumerate(keys):
        push(heap.bounds, heap.cells, size, key, np.full(4, key, np.float32))
    out = []
    for size in range(300, 0, -1):
        out.append(pop(heap.bounds, heap.cells, size, cell))
        assert (cell == out[-1]).all()
    assert out == sorted(keys)


@given(st.integers(0, 2**32 - 1), st.booleans())
@settings(deadline=None, max_examples=100)
def test_no_rotation_of_a_cell_is_farther_than_its_angle(seed, euler):
    rng = np.random.default_rng(seed)
    half, scale = rng.uniform(0.05, np.pi, 3), 0.5 ** rng.integers(0, 6)
    centre = rng.uniform(-2, 2, 3)
    middle, other = np.empty((3, 3), np.float32), np.empty((3, 3), np.float32)
    rotation_at(*centre, euler, middle)
    for corner in rng.choice([-1, 1, 0.5], (20, 3)):
        rotation_at(*(centre + corner * scale * half), euler, other)
        angle = np.arccos(np.clip((np.trace(middle.T @ other) - 1) / 2, -1, 1))
        assert angle <= cell_angle(half, scale, euler) + 2e-3  # arccos of single precision


@pytest.mark.parametrize("euler", [False, True])
def test_parameters_mean_what_scipy_and_the_contract_mean(euler):
    values, rotation = np.array([0.4, -0.3, 1.1]), np.empty((3, 3), np.float32)
    rotation_at(*values, euler, rotation)
    expected = rotation_from_euler_deg(np.degrees(values)) if euler else Rotation.from_rotvec(values).as_matrix()
    np.testing.assert_allclose(rotation, expected, atol=1e-6)


@given(st.integers(0, 2**32 - 1), st.sampled_from([1.0, 0.6]), st.sampled_from([8, 24, 64]))
@settings(deadline=None, max_examples=60)
def test_a_bound_is_never_above_the_error_anywhere_in_its_cell(seed, overlap, cells):
    """Random motions in a random cell, by exact nearest neighbours; also where the source leaves the grid."""
    rng = np.random.default_rng(seed)
    source, target = shell(seed), shell(seed + 1)
    central, scale = rng.uniform(-2, 2, 3), 0.5 ** rng.integers(1, 9)
    place, gap_half = rng.uniform(-0.6, 0.6, 3), rng.uniform(0, 0.3)
    space = space_of(source, target, cells=cells, overlap=overlap, place=place, gap_half=gap_half)
    cell, kept = 1 / space.points[0, 0] * source[0, 0], space.kept
    rotation, rotated = np.empty((3, 3), np.float32), np.empty((3, len(source)), np.float32)
    rotation_at(*central, False, rotation)
    rotate(space.points, rotation, rotated)
    chord = 2 * np.sin(cell_angle(space.rotation_half, scale, False) / 2)
    gap, squares = np.sqrt(3) * space.half[0], np.empty(len(source), np.float32)
    bound = squared_error_bound(
        rotated, space.reach, chord, space.centre, gap, space.distances, space.shape, kept, np.inf, squares
    )
    exact = exact_squared_error_bound(rotated, space.reach, chord, space.centre, gap, space, squares)
    nested = least_over_translations(
        space, rotated, space.reach, chord, 0.5, np.inf, squares, empty_heap(5000), np.empty(3, np.float32)
    )
    assert exact >= bound - 1e-3
    assert nested >= bound - 1e-3
    tree = cKDTree(target)
    for _ in range(30):
        other = Rotation.from_rotvec(central + rng.uniform(-1, 1, 3) * scale * np.pi).as_matrix()
        moved = source @ other.T + place + rng.uniform(-1, 1, 3) * gap_half
        error = np.sort(tree.query(moved)[0] ** 2)[:kept].sum() / cell**2
        assert bound <= error * (1 + 1e-4) + 1e-4
        assert exact <= error * (1 + 1e-4) + 1e-4
        assert nested <= error * (1 + 1e-4) + 1e-4


@given(st.integers(0, 2**32 - 1), st.sampled_from([1.0, 0.6]))
@settings(deadline=None, max_examples=30)
def test_the_error_read_off_the_grid_is_never_under_the_true_one(seed, overlap):
    rng = np.random.default_rng(seed)
    source, target = shell(seed), shell(seed + 1)
    grid = DistanceGrid.of(target, cells=20)
    motion = se3(Rotation.random(rng=rng).as_matrix(), rng.uniform(-0.5, 0.5, 3))
    rotated = np.ascontiguousarray((source @ motion[:3, :3].T / grid.cell).T, dtype=np.float32)
    place = ((motion[:3, 3] - grid.low) / grid.cell).astype(np.float32)
    kept = int(np.ceil(overlap * 60))
    voxel_target = ((target - grid.low) / grid.cell).astype(np.float32)
    error = squared_error(rotated, place, voxel_target, grid.labels, grid.shape, kept, np.empty(60, np.float32))
    truth = mean_squared_error(source, target, motion, overlap) * kept / grid.cell**2
    assert truth * (1 - 1e-4) <= error <= truth + 3 * kept * np.sqrt(truth / kept + 3) * 4


@pytest.mark.parametrize("degrees", [40, 90, 150, 180])
@pytest.mark.parametrize("parameters", [{}, {"motion": "centred"}])
def test_it_finds_what_icp_does_not(degrees, parameters):
    target, truth = turned(body(300), degrees)
    answer = GoIcp(**parameters).register(make_problem(body(300), target))
    np.testing.assert_allclose(answer.T_target_source, truth, atol=1e-9)
    assert answer.facts["certified"]
    assert answer.facts["gap"] < 1e-12
    assert answer.converged is True


def test_branch_and_bound_alone_finds_it_too():
    """As the paper has it, without a first search, from where ICP ends at a second minimum."""
    source = shell(3)
    target, truth = turned(source, 150)
    centred = source - source.mean(axis=0)
    place = target - target.mean(axis=0)
    first = icp(centred, place, np.eye(4)).T_target_source
    assert off_deg(first, truth) > 5
    found = search(centred, place, [np.eye(4)], Settings(**(SETTINGS | {"beam": 0, "threshold": 2e-3, "cells": 64})))
    assert off_deg(found.T_target_source, truth) < 1e-6
    assert found.nodes > 0


def least_by_grid(source, target, *, centred):
    """The least error that a dense grid of motions finds, each of the best followed by SciPy's nearest neighbours."""
    tree = cKDTree(target)
    steps = np.linspace(-np.pi, np.pi, 19)
    vectors = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3)
    vectors = vectors[np.linalg.norm(vectors, axis=1) <= np.pi + 0.2]
    shifts = [np.zeros(3)]
    if not centred:
        shifts = list(np.stack(np.meshgrid(*[np.linspace(-0.4, 0.4, 5)] * 3, indexing="ij"), axis=-1).reshape(-1, 3))
    rotations = Rotation.from_rotvec(vectors).as_matrix()
    turned_points = np.einsum("rij,nj->rni", rotations, source)
    errors = np.array([(tree.query(turned_points + shift)[0] ** 2).mean(axis=1) for shift in shifts])
    least = errors.min()
    if centred:
        # Down the hill from the best hundred, by smaller and smaller random turns.
        rng = np.random.default_rng(0)
        for index in np.argsort(errors[0])[:100]:
            rotation, error = rotations[index], errors[0][index]
            for size in (0.1, 0.05, 0.02, 0.01):
                turns = Rotation.from_rotvec(size * rng.normal(size=(20, 3))).as_matrix() @ rotation
                tried = (tree.query(np.einsum("rij,nj->rni", turns, source))[0] ** 2).mean(axis=1)
                if tried.min() < error:
                    rotation, error = turns[np.argmin(tried)], tried.min()
            least = min(least, error)
        return least
    for flat in np.argsort(errors, axis=None)[:30]:
        shift, index = np.unravel_index(flat, errors.shape)
        moved = icp(source, target, se3(rotations[index], shifts[shift])).T_target_source
        least = min(least, mean_squared_error(source, target, moved, 1.0))
    return least


@pytest.mark.parametrize("seed", [0, 1, 4, 5])
def test_certificates_are_true_over_rotations(seed):
    """Two shapes that do not match: all errors are large, so that a certificate says something."""
    source, target = shell(seed), shell(seed + 1000)
    source, target = source - source.mean(axis=0), target - target.mean(axis=0)
    box = Box(middle=np.zeros(3), half=np.zeros(3))
    found = search(source, target, [np.eye(4)], Settings(**(SETTINGS | {"threshold": 5e-3, "translation": box})))
    # The answer's ICP may shift; the bound is over rotations about matched centroids.
    assert found.gap <= 5e-3 * (1 + 1e-6)
    assert found.error > 5e-3, "a certificate that says something"
    assert least_by_grid(source, target, centred=True) >= found.error - found.gap


@pytest.mark.parametrize("seed", [1])
def test_certificates_are_true_over_all_motions(seed):
    source = shell(seed)
    rng = np.random.default_rng(seed)
    target = turned(source, 100)[0] + 0.1 * rng.normal(size=source.shape)
    source, target = source - source.mean(axis=0), target - target.mean(axis=0)
    first = search(source, target, [np.eye(4)], Settings(**(SETTINGS | {"threshold": 1.0})))
    threshold = 0.85 * first.error
    found = search(source, target, [np.eye(4)], Settings(**(SETTINGS | {"threshold": threshold, "budget_s": 60})))
    assert found.gap <= threshold * (1 + 1e-6)
    assert found.nodes > 100
    assert least_by_grid(source, target, centred=False) >= found.error - found.gap


def test_a_budget_is_obeyed_and_the_answer_is_then_uncertified():
    problem = make_problem(shell(0, 400), shell(1, 400))
    method = GoIcp(threshold=1e-6, budget_ms=200)
    method.register(problem)  # compiles
    began = time.perf_counter()
    answer = method.register(problem)
    assert time.perf_counter() - began < 5
    assert answer.facts["certified"] is False
    assert answer.converged is False
    assert 0 < answer.facts["gap"] <= answer.facts["error"]


def test_a_budget_is_obeyed_with_trimming_too():
    """Where half of the points count, bounds are weak and one search for a translation could take forever."""
    cloud = body(500)
    target = turned(cloud, 70)[0] + 0.1 * np.random.default_rng(0).normal(size=cloud.shape)
    problem = make_problem(cloud, target)
    method = GoIcp(overlap=0.6, budget_ms=200)
    method.register(problem)  # compiles
    began = time.perf_counter()
    answer = method.register(problem)
    assert time.perf_counter() - began < 10
    assert answer.facts["certified"] is False


@pytest.mark.parametrize("overlap", [1.0, 0.6])
def test_a_budget_cuts_the_first_search_short(overlap):
    """A beam that would take minutes; what was seen until then is used."""
    target, truth = turned(body(400), 20)
    problem = make_problem(body(400), target + 0.05 * np.random.default_rng(0).normal(size=(400, 3)))
    GoIcp(overlap=overlap).register(problem)  # compiles
    began = time.perf_counter()
    answer = GoIcp(overlap=overlap, beam=1_000_000, starts=1000, threshold=1e-6, budget_ms=300).register(problem)
    assert time.perf_counter() - began < 5
    assert answer.facts["nodes"] == 0
    assert answer.facts["certified"] is False
    assert off_deg(answer.T_target_source, truth) < 10


@pytest.mark.parametrize("overlap", [1.0, 0.7])
def test_error_and_certificate_are_about_the_whole_clouds(overlap):
    """Of which a tenth is searched with."""
    source = body(5000)
    target = turned(source, 40)[0] + 0.1 * np.random.default_rng(0).normal(size=source.shape)
    loose, tight = (
        GoIcp(overlap=overlap, max_points=400, threshold=threshold, budget_ms=300).register(
            make_problem(source, target)
        )
        for threshold in (1e-1, 1e-5)
    )
    for answer in (loose, tight):
        squares = np.sort(cKDTree(target).query(transform(answer.T_target_source, source))[0] ** 2)
        unit = np.linalg.norm(target - target.mean(axis=0), axis=1).max()
        error = squares[: int(np.ceil(overlap * len(squares)))].mean() / unit**2
        assert answer.facts["points"] == 400
        assert answer.facts["error"] == answer.facts["gap"] == pytest.approx(error)
    assert loose.facts["certified"] is True
    assert tight.facts["certified"] is False


@pytest.mark.parametrize("turn_deg", [0.0, 60.0])
def test_a_prior_may_fix_axes(turn_deg):
    """All starts of the first search are different rotations, and there is nothing to halve without any range."""
    source = body(300)
    truth = se3(rotation_from_euler_deg([0, 0, turn_deg * 0.9]), np.array([0.1, 0, 0]))
    prior = MotionPrior((0, 0, -turn_deg), (0, 0, turn_deg), (-0.5, -0.5, -0.5), (0.5, 0.5, 0.5))
    noisy = transform(truth, source) + 0.05 * np.random.default_rng(0).normal(size=source.shape)
    answer = GoIcp(motion="prior", budget_ms=None, max_nodes=50, threshold=1e-6).register(
        make_problem(source, noisy, prior=prior)
    )
    assert off_deg(answer.T_target_source, truth) < 5


def test_more_nodes_never_make_the_gap_wider():
    problem = make_problem(shell(0), shell(1))
    gaps = [
        GoIcp(motion="centred", threshold=1e-3, budget_ms=None, max_nodes=nodes).register(problem).facts["gap"]
        for nodes in (500, 5000, 50_000)
    ]
    assert gaps == sorted(gaps, reverse=True)
    assert gaps[-1] < gaps[0]


def test_progress_is_told():
    told = []
    answer = GoIcp(motion="centred", threshold=1e-3, budget_ms=None, max_nodes=20_000).register(
        make_problem(shell(0), shell(1)), progress=lambda *news: told.append(news)
    )
    errors, bounds, nodes = zip(*told, strict=True)
    assert list(errors) == sorted(errors, reverse=True)
    assert list(nodes) == sorted(nodes)
    assert nodes[-1] == answer.facts["nodes"]
    assert errors[-1] - bounds[-1] == pytest.approx(answer.facts["gap"])
    assert all(bound <= error for error, bound in zip(errors, bounds, strict=True))


def test_the_prior_narrows_the_search():
    source = body(200)
    truth = se3(rotation_from_euler_deg([30, 10, 40]), np.array([0.1, -0.2, 0.3]))
    prior = MotionPrior((0, 0, 0), (45, 45, 45), (-0.5, -0.5, -0.5), (0.5, 0.5, 0.5))
    problem = make_problem(source, transform(truth, source), prior=prior)
    answer = GoIcp(motion="prior").register(problem)
    np.testing.assert_allclose(answer.T_target_source, truth, atol=1e-9)
    noisy = make_problem(source, transform(truth, source) + 0.03 * np.random.default_rng(0).normal(size=(200, 3)),
                         prior=prior)  # fmt: skip
    narrow, full = (
        GoIcp(motion=motion, threshold=1e-3, budget_ms=None, max_nodes=300).register(noisy)
        for motion in ("prior", "full")
    )
    assert narrow.facts["gap"] < full.facts["gap"]


def test_partial_overlap_by_trimming():
    cloud = body(600)
    target, truth = turned(cloud, 70)
    # Each cloud lacks what lies beyond a plane of its own; about two thirds of the source have a partner.
    source = cloud[cloud[:, 0] < np.quantile(cloud[:, 0], 0.8)]
    target = target[target[:, 1] > np.quantile(target[:, 1], 0.2)]
    answer = GoIcp(overlap=0.6).register(make_problem(source, target))
    np.testing.assert_allclose(answer.T_target_source, truth, atol=1e-6)


@pytest.mark.parametrize("count", [10, 30_000])
def test_sizes(count):
    rng = np.random.default_rng(0)
    cloud = rng.normal(size=(count, 3)) * [1, 0.6, 0.3]
    target, truth = turned(cloud, 50)
    method = GoIcp()
    answer = method.register(make_problem(cloud, target))
    assert off_deg(answer.T_target_source, truth) < (1e-6 if count > 10 else 180)
    assert answer.facts["points"] == min(count, 1000)


@pytest.mark.parametrize(
    "points",
    [
        np.outer(np.linspace(0, 1, 40), [1, 2, 3]),
        np.random.default_rng(0).normal(size=(50, 3)) * [1, 1, 0],
        np.repeat(np.random.default_rng(0).normal(size=(5, 3)), 8, axis=0),
        np.random.default_rng(0).normal(size=(3, 3)),
        np.ones((6, 3)),
    ],
    ids=["line", "plane", "duplicates", "three", "one place"],
)
@pytest.mark.parametrize("overlap", [1.0, 0.5])
def test_degenerate_clouds_get_a_rigid_motion_in_time(points, overlap):
    target = turned(points, 60)[0]
    method = GoIcp(overlap=overlap, budget_ms=300)
    method.register(make_problem(points, target))
    began = time.perf_counter()
    answer = method.register(make_problem(points, target))
    assert why_not_rigid(answer.T_target_source) is None
    assert time.perf_counter() - began < 5
    assert answer.facts["error"] < 1e-3


@pytest.mark.parametrize(
    "parameters",
    [
        {"overlap": 0.0}, {"overlap": 1.5}, {"threshold": 0.0}, {"starts": 0}, {"beam": -1}, {"finalists": -1},
        {"max_points": 0}, {"cells": 1}, {"max_translation": -0.1}, {"max_nodes": -1}, {"budget_ms": -1.0},
    ],
)  # fmt: skip
def test_parameters_out_of_range_are_refused(parameters):
    with pytest.raises(ValueError, match=next(iter(parameters))):
        GoIcp(**parameters).register(make_problem(body(50), body(50)))


def test_a_preset_of_its_own_for_each_use():
    assert GoIcp.presets["paper"]["cells"] == 300
    assert GoIcp.presets["fast"]["motion"] == "centred"
    assert GoIcp.presets["partial"]["overlap"] == 0.6
