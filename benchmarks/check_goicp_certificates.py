"""Are Go-ICP's certificates true? Small problems, and for each a dense search over SE(3) for a better answer.

    python benchmarks/check_goicp_certificates.py [--problems 200] [--seed 0]

A problem is 60 points on a random ellipsoid, and the same turned, shifted and made noisy (0.1 of its size), or another
ellipsoid: all errors are large, so that a certificate needs branch and bound. The dense search is SciPy's nearest
neighbours at 3,000 rotations times 27 translations, and ICP from the 30 best.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from numpy.typing import NDArray
from regbench_baselines.goicp.search import Settings, mean_squared_error, search
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from regbench.compiled.cache import settle
from regbench.geometry.icp import icp
from regbench.geometry.se3 import se3

POINTS = 60
# Of the least error found first: certify that none is smaller by more than this share of it.
SHARE = 0.9


def ellipsoid(rng: np.random.Generator) -> NDArray[np.float64]:
    points = rng.normal(size=(POINTS, 3))
    return points / np.linalg.norm(points, axis=1)[:, None] * rng.uniform(0.3, 1, 3)


def problem(seed: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    rng = np.random.default_rng(seed)
    source = ellipsoid(rng)
    if seed % 2:
        target = ellipsoid(rng)
    else:
        target = Rotation.random(rng=rng).apply(source) + 0.1 * rng.normal(size=source.shape)
    return source - source.mean(axis=0), target - target.mean(axis=0)


def least_by_grid(source: NDArray[np.float64], target: NDArray[np.float64]) -> float:
    tree = cKDTree(target)
    rotations = Rotation.random(3000, rng=np.random.default_rng(0)).as_matrix()
    steps = np.linspace(-0.4, 0.4, 3)
    shifts = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3)
    turned = np.einsum("rij,nj->rni", rotations, source)
    errors = np.array([(np.asarray(tree.query(turned + shift)[0]) ** 2).mean(axis=1) for shift in shifts])
    least = float(errors.min())
    for flat in np.argsort(errors, axis=None)[:30]:
        shift, index = np.unravel_index(flat, errors.shape)
        moved = icp(source, target, se3(rotations[index], shifts[shift])).T_target_source
        least = min(least, mean_squared_error(source, target, moved, 1.0))
    return least


def main() -> None:
    settle()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--problems", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    certified, broken, better, seconds, shares = 0, 0, 0, [], []
    for seed in range(arguments.seed, arguments.seed + arguments.problems):
        source, target = problem(seed)
        settings = Settings(
            threshold=np.inf, overlap=1.0, euler_rad=None, translation=None, cells=48, beam=300, starts=32,
            finalists=4, max_points=1000, max_nodes=None, budget_s=60.0,
        )  # fmt: skip
        first = search(source, target, [np.eye(4)], settings)
        threshold = SHARE * first.error
        began = time.perf_counter()
        found = search(source, target, [np.eye(4)], Settings(**(vars(settings) | {"threshold": threshold})))
        seconds.append(time.perf_counter() - began)
        least = least_by_grid(source, target)
        better += least < found.error * (1 - 1e-9)
        shares.append(found.gap / found.error)
        if found.gap <= threshold * (1 + 1e-6):
            certified += 1
            if least < found.error - found.gap:
                broken += 1
                print(f"problem {seed}: certified {found.error:.6g} less {found.gap:.6g}, but {least:.6g} was found")
        done = seed - arguments.seed + 1
        if done % 10 == 0:
            print(f"{done} problems: {certified} certified, {broken} broken", flush=True)
    print(
        f"{arguments.problems} problems: {certified} certified in a median of {np.median(seconds):.1f} s "
        f"(longest {np.max(seconds):.1f} s), gap / error {np.median(shares):.2f}; {broken} certificates broken; "
        f"the dense search found a smaller error, within the gap, in {better}"
    )


if __name__ == "__main__":
    main()
