"""Curves, fronts, picks and packed clouds, against SciPy and brute force."""

import base64

import numpy as np
import pytest
from scipy import stats

from regbench.report.curves import ecdf, pareto_front, shares_within
from regbench.report.extremes import pick
from regbench.report.packed_clouds import pack_pair
from regbench.report.trial_errors import TrialErrors

RNG = np.random.default_rng(0)
SAMPLES = [RNG.gamma(1, size=1000), RNG.integers(0, 5, 300).astype(float), np.zeros(7), np.array([3.0])]


@pytest.mark.parametrize("values", SAMPLES)
@pytest.mark.parametrize("points", [2, 50, 10_000])
def test_every_point_of_an_ecdf_is_scipys(values, points):
    x, y = ecdf(values, points)
    assert len(x) <= points
    assert (x[0], x[-1]) == (values.min(), values.max())
    np.testing.assert_allclose(y, stats.ecdf(values).cdf.evaluate(x))
    np.testing.assert_allclose(shares_within(values, x), y)


def test_no_value_gives_no_curve():
    assert [len(axis) for axis in ecdf([], 10)] == [0, 0]
    assert np.isnan(shares_within([], [1.0])).all()


def test_the_front_is_what_brute_force_finds():
    for _ in range(50):
        points = RNG.integers(0, 6, (12, 2)).astype(float)
        expected = [
            not any((b[0] <= a[0] and b[1] >= a[1]) and (b[0], b[1]) != (a[0], a[1]) for b in points) for a in points
        ]
        assert pareto_front(points[:, 0].tolist(), points[:, 1].tolist()) == expected


def errors(misses, answered=None, problems=None):
    n = len(misses)
    return TrialErrors(
        problems=np.arange(n) if problems is None else np.array(problems),
        answered=np.ones(n, bool) if answered is None else np.array(answered),
        rotation_errors_deg=np.array(misses, float),
        translation_errors=np.zeros(n),
        T_target_source=np.tile(np.eye(4), (n, 1, 1)),
    )


def picked(*arguments, worst=2, median=1, best=2, **more):
    return [(p.kind, p.trial) for p in pick(errors(*arguments, **more), worst=worst, median=median, best=best)]


def test_worst_median_and_best_in_order():
    assert picked([3, 9, 1, 7, 5]) == [("worst", 1), ("worst", 3), ("median", 4), ("best", 2), ("best", 0)]
    assert picked([], worst=3) == []
    assert picked([1.0], worst=3, best=1) == [("worst", 0), ("median", 0), ("best", 0)]


def test_failed_trials_are_not_picked_and_a_problem_is_picked_once():
    assert picked([3, 9, 1], answered=[True, False, True], median=0) == [
        ("worst", 0),
        ("worst", 2),
        ("best", 2),
        ("best", 0),
    ]
    assert picked([3, 9, 1], problems=[0, 0, 1], median=0, best=0) == [("worst", 0), ("worst", 2)]


def test_a_length_counts_as_the_tables_count_it():
    both = errors([1.0, 2.0])
    far = TrialErrors(
        both.problems, both.answered, both.rotation_errors_deg, np.array([0.05, 0.0]), both.T_target_source
    )
    np.testing.assert_allclose(far.misses_deg, [5.0, 2.0])


def test_packed_clouds_come_back_within_half_a_step():
    source, target = RNG.normal(size=(500, 3)), RNG.normal(size=(60, 3)) * 5 + 100
    packed = pack_pair(source, target, 800)
    for name, cloud in (("source", source), ("target", target)):
        integers = np.frombuffer(base64.b64decode(packed[name]), "<u2").reshape(-1, 3)
        back = np.array(packed["low"]) + packed["step"] * integers
        assert np.abs(back - cloud).max() <= packed["step"] / 2 * (1 + 1e-6)
    assert len(base64.b64decode(pack_pair(source, target, 100)["source"])) == 100 * 3 * 2
