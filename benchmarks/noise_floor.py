"""How exact an answer on a noisy protocol can be: one Kabsch step on the true matches, which no method knows.

By hand: python benchmarks/noise_floor.py [--protocol modelnet40/noise@1] [--limit N].
"""

from __future__ import annotations

import argparse

import numpy as np

from regbench.datasets.store import data_dir
from regbench.geometry.kabsch import kabsch
from regbench.metrics.rotation import euler_residuals_deg, mae, rmse
from regbench.protocols.draws import generator
from regbench.registry import find_protocol


def main() -> None:
    """Print the errors of the true matches' motions."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--protocol", default="modelnet40/noise@1")
    parser.add_argument("--limit", type=int)
    arguments = parser.parse_args()
    problems = find_protocol(arguments.protocol).open(data_dir(None))
    found, truths = [], []
    for index in range(min(len(problems), arguments.limit or len(problems))):
        pair = problems.pair(index)
        # Row i of the shape is row argsort(permutation)[i] of a permuted cloud.
        source, target = (
            cloud[np.argsort(generator(problems.protocol, index, f"permutation of {which}").permutation(len(cloud)))]
            for cloud, which in ((pair.source, "source"), (pair.target, "target"))
        )
        found.append(kabsch(source, target))
        truths.append(pair.T_target_source)
    answers, truth = np.stack(found), np.stack(truths)
    rotation = euler_residuals_deg(answers[:, :3, :3], truth[:, :3, :3])
    translation = answers[:, :3, 3] - truth[:, :3, 3]
    print(
        f"{arguments.protocol}, {len(found)} problems, Kabsch on the true matches: RMSE(R) {rmse(rotation):.4f}, "
        f"MAE(R) {mae(rotation):.4f} deg; RMSE(t) {rmse(translation):.5f}, MAE(t) {mae(translation):.5f}"
    )


if __name__ == "__main__":
    main()
