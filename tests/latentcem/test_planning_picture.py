"""The picture of a search shows what the planner did, and the truth is in the picture alone."""

import sys

import numpy as np
import pytest
from PIL import Image

from regbench.contract import Registrar
from regbench.errors import UserError
from regbench.testing import clouds
from regbench_latentcem.actions import action_of, motion_of
from regbench_latentcem.planning_picture import planning_figure, plot_planning
from regbench_latentcem.registrar import LatentCem


def small(**parameters):
    return LatentCem(**{"model": "equivariant", "T": 4, "N": 60, "K": 6, **parameters})


@pytest.fixture(scope="module")
def problem():
    return clouds.easy_problem(150)


def panels_of(figure, columns):
    axes = np.array(figure.axes).reshape(3, columns)
    return axes[:2], axes[2]


def offsets(panel):
    return [np.asarray(collection.get_offsets()) for collection in panel.collections]


def test_the_search_is_that_of_register(problem):
    frame, _, found = small().search(problem[0])
    assert found.candidates.shape == (4, 1, 60, 6)
    answer = frame.from_local(motion_of(found.actions[0].numpy()))
    np.testing.assert_array_equal(answer, small().register(problem[0]).T_target_source)


def test_candidates_elites_mean_and_truth_lie_where_the_planner_had_them(problem):
    frame, _, found = small().search(problem[0])
    planes, _ = panels_of(planning_figure(small(), *problem), 5)  # start, iterations 1, 2, 3 and 4
    truth_deg = np.degrees(action_of(frame.to_local(problem[1]))[:3])
    for row, plane in enumerate(([0, 1], [0, 2])):
        assert offsets(planes[row, 0]) == [], "nothing is drawn before the first iteration"
        for t in range(1, 5):
            candidates, elites = offsets(planes[row, t])
            np.testing.assert_allclose(candidates, np.degrees(found.candidates[t - 1, 0].numpy())[:, plane])
            np.testing.assert_allclose(elites, np.degrees(found.elites[t - 1, 0].numpy())[:, plane])
        for t in range(5):
            mean, truth = (line.get_xydata()[0] for line in planes[row, t].lines)
            np.testing.assert_allclose(mean, np.degrees(found.means[t, 0].numpy())[plane])
            np.testing.assert_allclose(truth, truth_deg[plane])


def test_the_clouds_come_together(problem):
    _, below = panels_of(planning_figure(small(T=10, N=400, K=25), *problem), 6)

    def apart(panel):
        target, source = offsets(panel)
        return np.abs(target[:, None] - source).sum(axis=2).min(axis=1).mean()

    assert apart(below[-1]) < 0.1 * apart(below[0])


def test_without_a_truth_the_search_is_the_same(problem):
    known, unknown = (panels_of(planning_figure(small(), problem[0], T), 5)[0] for T in (problem[1], None))
    np.testing.assert_array_equal(offsets(known[0, 4])[0], offsets(unknown[0, 4])[0])
    assert len(unknown[0, 4].lines) == 1
    assert unknown[0, 4].get_title() == "iteration 4"


@pytest.mark.parametrize("parameters", [{}, {"T": 1}, {"refine": "verify", "restarts": 2}, {"start": "closed_form"}])
def test_a_png_is_written(problem, tmp_path, parameters):
    plot_planning(small(**parameters), *problem, tmp_path / "search.png")
    with Image.open(tmp_path / "search.png") as image:
        assert image.format == "PNG"


def test_what_cannot_be_drawn_is_said_in_one_line(problem, tmp_path, monkeypatch):
    class Other(Registrar):
        name = "other"

    path = tmp_path / "search.png"
    with pytest.raises(UserError, match="'other' has no planner; give --method latentcem"):
        plot_planning(Other(), *problem, path)
    with pytest.raises(UserError, match="no search to draw with T=0"):
        plot_planning(small(T=0), *problem, path)
    with pytest.raises(UserError, match=r"search\.png: cannot be written"):
        plot_planning(small(T=1), *problem, tmp_path / "gone" / "search.png")
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(UserError, match=r'drawing needs matplotlib, .*: pip install "regbench\[plots\]"'):
        plot_planning(small(), *problem, path)
    assert not path.exists()
