"""Our compiled ICP against open3d's and against its floor, on one core. By hand: python benchmarks/bench_icp.py.

Both start where `icp` does and have its default settings. The floor is what no exact ICP on a k-d tree can leave out:
the tree, a nearest neighbour for every point at every pose that our ICP visited (from the match before), and as many
motions of least squares. Times are medians over pairs of each pair's median over rounds; contenders take turns.
"""

from __future__ import annotations

import argparse
import os
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from regbench.compiled.cache import settle

settle()  # else numba may load code of an older nearest_tree.py

import numpy as np  # noqa: E402
import small_gicp  # noqa: E402
from numba import njit  # noqa: E402
from regbench_baselines.icp import Icp  # noqa: E402
from regbench_baselines.open3d_library import import_open3d, point_cloud, point_to_point_icp  # noqa: E402
from scipy.spatial import cKDTree  # noqa: E402

from regbench.geometry.icp import icp  # noqa: E402
from regbench.geometry.local_frame import LocalFrame  # noqa: E402
from regbench.geometry.matches import add_match, fit_matches, moved_point  # noqa: E402
from regbench.geometry.nearest_tree import DEEPEST, build_tree, nearest_in_tree  # noqa: E402
from regbench.geometry.se3 import transform  # noqa: E402
from regbench.geometry.starts import start_of  # noqa: E402
from regbench.metrics.rotation import euler_residuals_deg, rmse, rotation_error_deg  # noqa: E402
from regbench.registry import find_protocol  # noqa: E402

DATA = Path(__file__).resolve().parents[1] / "data"
PROTOCOLS = ("modelnet40/clean@1", "modelnet40/noise@1")
METHOD = Icp()
LIMITS = {"max_distance": METHOD.max_distance, "max_iterations": METHOD.max_iterations, "tolerance": METHOD.tolerance}


@njit(cache=True)
def sweeps(source, tree, axes, rotations, translations, fit):
    """Ask for all nearest neighbours at each pose, and fit a motion to them if asked to."""
    places = np.zeros(len(source), np.int64)
    lows, highs, beyond = np.empty(DEEPEST, np.int64), np.empty(DEEPEST, np.int64), np.empty(DEEPEST)
    rotation, translation = np.empty((3, 3)), np.empty(3)
    sums, products = np.empty((2, 3)), np.empty((3, 3))
    for pose in range(len(rotations)):
        place = places[0]
        for index in range(len(source)):
            x, y, z = moved_point(rotations[pose], translations[pose], source, index)
            guess = places[index] if pose else place
            place, _ = nearest_in_tree(tree, axes, x, y, z, guess, lows, highs, beyond)
            places[index] = place
        if fit:
            sums[:] = 0.0
            products[:] = 0.0
            for index in range(len(source)):
                add_match(sums, products, source, index, tree, places[index])
            fit_matches(sums, products, len(source), source, tree, rotation, translation)
    return places


def contenders(frame: LocalFrame, start: np.ndarray, poses: np.ndarray) -> dict[str, Callable[[], Any]]:
    """Return what is timed on a pair."""
    source, target = frame.source, frame.target
    rotations, translations = np.ascontiguousarray(poses[:, :3, :3]), np.ascontiguousarray(poses[:, :3, 3])
    moved = [transform(pose, source) for pose in poses]

    def ours(fit: bool) -> None:
        tree, _, axes = build_tree(target)
        sweeps(source, tree, axes, rotations, translations, fit)

    def scipy() -> None:
        tree = cKDTree(target)
        for points in moved:
            tree.query(points)

    def koide() -> None:
        tree = small_gicp.KdTree(target)
        for points in moved:
            tree.batch_nearest_neighbor_search(points)

    return {
        "open3d": lambda: point_to_point_icp(point_cloud(source), point_cloud(target), start, **LIMITS),
        "ours": lambda: icp(source, target, start, **LIMITS),
        "floor": lambda: ours(True),
        "tree and queries: ours": lambda: ours(False),
        "tree and queries: SciPy": scipy,
        "tree and queries: small_gicp": koide,
    }


def interleaved_ms(forms: dict[str, Callable[[], Any]], rounds: int) -> dict[str, tuple[float, float]]:
    """Return each form's median times, on the wall and on the CPU: the latter alone can be trusted on a busy core."""
    samples: dict[str, list[tuple[float, float]]] = {name: [] for name in forms}
    for _ in range(rounds):
        for name, form in forms.items():
            wall, cpu = time.perf_counter_ns(), time.process_time_ns()
            form()
            samples[name].append(((time.perf_counter_ns() - wall) / 1e6, (time.process_time_ns() - cpu) / 1e6))
    return {name: tuple(np.median(values, axis=0)) for name, values in samples.items()}


def open3d_iterations(frame: LocalFrame, start: np.ndarray, answer: np.ndarray) -> int:
    """Return the fewest iterations after which open3d gives its answer: it does not say how many it made."""
    fewest, most = 0, METHOD.max_iterations
    clouds = point_cloud(frame.source), point_cloud(frame.target)
    while fewest < most:
        middle = (fewest + most) // 2
        found = point_to_point_icp(*clouds, start, **LIMITS | {"max_iterations": middle})
        if np.array_equal(found.transformation, answer):
            most = middle
        else:
            fewest = middle + 1
    return fewest


def bench(name: str, data: Path, pairs: int, rounds: int) -> None:
    """Measure a protocol and print its figures."""
    problems = find_protocol(name).open(data)
    chosen = np.linspace(0, len(problems) - 1, pairs).astype(int)
    times: dict[str, list[tuple[float, float]]] = {}
    iterations: dict[str, list[int]] = {"open3d": [], "ours": []}
    answers: dict[str, list[np.ndarray]] = {"open3d": [], "ours": []}
    truths = []
    for number, index in enumerate([chosen[0], *chosen]):  # the first pair once more, to warm up
        problem, pair = problems.problem(int(index), protocol=name)
        frame = LocalFrame.of(problem)
        start = start_of(problem, frame, METHOD.init)
        found = icp(frame.source, frame.target, start, **LIMITS)
        limits = ({**LIMITS, "max_iterations": most} for most in range(max(found.iterations, 1)))
        poses = np.stack([icp(frame.source, frame.target, start, **limit).T_target_source for limit in limits])
        forms = contenders(frame, start, poses)
        medians = interleaved_ms(forms, rounds)
        if number == 0:
            continue
        for form, median in medians.items():
            times.setdefault(form, []).append(median)
        theirs = np.asarray(forms["open3d"]().transformation)
        iterations["open3d"].append(open3d_iterations(frame, start, theirs))
        iterations["ours"].append(found.iterations)
        answers["open3d"].append(frame.from_local(theirs))
        answers["ours"].append(frame.from_local(found.T_target_source))
        truths.append(pair.T_target_source)
    print(f"{name}: {pairs} pairs, {rounds} rounds")
    for form, values in times.items():
        wall, cpu = np.median(values, axis=0)
        ratio = np.median(np.divide(values, times["ours"])[:, 1])
        print(f"  {form:30}{wall:9.3f} ms, CPU {cpu:8.3f} ms   median ratio of CPU to ours {ratio:5.2f}")
    R_truth = np.stack(truths)[:, :3, :3]
    for form, motions in answers.items():
        rotations = np.stack(motions)[:, :3, :3]
        euler, angle = rmse(euler_residuals_deg(rotations, R_truth)), rotation_error_deg(rotations, R_truth)
        print(
            f"  {form:8} RMSE(R) {euler:.4f} deg (Euler), {np.sqrt(np.mean(angle**2)):.4f} deg (angle); "
            f"iterations: median {statistics.median(iterations[form]):g}, mean {statistics.mean(iterations[form]):.1f}"
        )
    apart = rotation_error_deg(*(np.stack(answers[form])[:, :3, :3] for form in ("ours", "open3d")))
    print(
        f"  apart: {np.sqrt(np.mean(apart**2)):.4f} deg RMSE, most {apart.max():.4f}, over 0.05: {(apart > 0.05).sum()}"
    )


def main() -> None:
    """Run both protocols."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=DATA, help="folder of the prepared data")
    parser.add_argument("--pairs", type=int, default=100, help="pairs of each protocol")
    parser.add_argument("--rounds", type=int, default=5, help="calls of each contender on a pair")
    asked = parser.parse_args()
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})  # open3d does not heed OMP_NUM_THREADS
    import_open3d()
    for name in PROTOCOLS:
        bench(name, asked.data, asked.pairs, asked.rounds)


if __name__ == "__main__":
    main()
