"""What a least residual can tell: of a method's failures, how many fit better than the truth does.

By hand: python benchmarks/second_minima.py [super4pcs] [--protocol modelnet40/resampled@1] [--limit 200]. A residual
is the mean squared distance to the nearest point, both ways, as super4pcs judges; the truth's is taken as it is, and
where ICP ends from it.
"""

from __future__ import annotations

import argparse
from collections import Counter

from regbench.compiled.cache import settle

settle()  # before numba is imported

import numpy as np  # noqa: E402
from regbench_baselines.super4pcs.judgement import Judgement  # noqa: E402

from regbench.datasets.store import data_dir  # noqa: E402
from regbench.geometry.icp import icp  # noqa: E402
from regbench.metrics.rotation import rotation_error_deg  # noqa: E402
from regbench.registry import MethodRegistry, find_protocol, parse_methods  # noqa: E402

FAILED_DEG = 5.0


def main() -> None:
    """Print how many failures there are, how many fit better than the truth, and their categories."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("method", nargs="?", default="super4pcs")
    parser.add_argument("--protocol", default="modelnet40/resampled@1")
    parser.add_argument("--limit", type=int, default=200)
    arguments = parser.parse_args()
    (spec,) = parse_methods([arguments.method])
    found = MethodRegistry().resolve(spec)
    method = found.cls(**found.parameters)
    method.prepare()
    problems = find_protocol(arguments.protocol).open(data_dir(None))
    categories: Counter[str] = Counter()
    failures = better = better_than_icp = 0
    for index in range(min(len(problems), arguments.limit)):
        problem, pair = problems.problem(index, protocol=arguments.protocol)
        answer, truth = method.register(problem).T_target_source, pair.T_target_source
        if rotation_error_deg(answer[None, :3, :3], truth[None, :3, :3])[0] <= FAILED_DEG:
            continue
        judge = Judgement(np.array(problem.source), np.array(problem.target), overlap=1.0)
        from_truth = icp(problem.source, problem.target, truth).T_target_source
        residual = judge.residual(answer)
        failures += 1
        better += residual < judge.residual(truth)
        better_than_icp += residual < min(judge.residual(truth), judge.residual(from_truth))
        categories[pair.label] += 1
    print(f"{arguments.method} on the first {arguments.limit} problems of {arguments.protocol}:")
    print(
        f"{failures} failures (over {FAILED_DEG:g} deg): {', '.join(f'{n} {c}' for n, c in categories.most_common())}"
    )
    print(f"{better} with a residual under the truth's, {better_than_icp} also under that of ICP from the truth")


if __name__ == "__main__":
    main()
