"""Figures of a measurement against independent ones, and measurements that are kept."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from regbench.contract import Registration
from regbench.errors import UserError
from regbench_latentcem import measurement
from regbench_latentcem.measurement import Kept, Problems, measure
from regbench_latentcem.registrar import LatentCem

SMALL = {"model": "equivariant", "T": 3, "N": 60, "K": 6}


@pytest.fixture(scope="module")
def problems():
    return Problems.of("demo@1", Path("none"), 3, "cpu")


def euler_zyx_deg(T):
    return Rotation.from_matrix(T[:3, :3]).as_euler("zyx", degrees=True)


def test_the_first_problems_of_a_protocol_are_taken(problems):
    assert len(problems.pairs) == 3
    assert problems.name.startswith("demo@1 3 ")
    with pytest.raises(UserError, match="modelnet40 is not prepared in none"):
        Problems.of("modelnet40/clean@1", Path("none"), 3, "cpu")


def test_figures_are_those_of_the_definitions(problems):
    found = measure(LatentCem(**SMALL), problems)
    answers = [LatentCem(**SMALL).register(problem).T_target_source for problem, _ in problems.pairs]
    truths = [truth for _, truth in problems.pairs]
    angles = np.array([euler_zyx_deg(T) - euler_zyx_deg(truth) for T, truth in zip(answers, truths, strict=True)])
    shifts = np.array([(T - truth)[:3, 3] for T, truth in zip(answers, truths, strict=True)])
    errors = [
        np.degrees(Rotation.from_matrix(truth[:3, :3].T @ T[:3, :3]).magnitude())
        for T, truth in zip(answers, truths, strict=True)
    ]
    assert found["rmse_r_deg"] == pytest.approx(np.sqrt((angles**2).mean()), rel=1e-6)
    assert found["mae_r_deg"] == pytest.approx(np.abs(angles).mean(), rel=1e-6)
    assert found["rmse_t"] == pytest.approx(np.sqrt((shifts**2).mean()), rel=1e-6)
    assert found["mae_t"] == pytest.approx(np.abs(shifts).mean(), rel=1e-6)
    assert found["rre_median_deg"] == pytest.approx(np.median(errors), rel=1e-6)
    assert (found["n"], found["failures"]) == (3, 0)
    assert 0 < found["plan_ms"] < found["time_ms"]


class Scripted(LatentCem):
    """Answers the truth but for one problem, on which it fails."""

    answers = ()
    calls = 0

    def prepare(self):
        pass

    def warm_up(self, problem):
        pass

    def register(self, problem):
        self.calls += 1
        if self.calls == 2:
            raise ValueError("the planner's rewards are not finite")
        return Registration(T_target_source=self.answers[self.calls - 1], stages_s={"plan": 1.5})


def test_a_failure_counts_as_the_identity(problems, monkeypatch):
    truths = [truth for _, truth in problems.pairs]
    monkeypatch.setattr(Scripted, "answers", truths)
    found = measure(Scripted(), problems)
    assert (found["n"], found["failures"], found["plan_ms"]) == (3, 1, 1500)
    assert found["mae_r_deg"] == pytest.approx(np.abs(euler_zyx_deg(truths[1])).sum() / 9)
    assert found["mae_t"] == pytest.approx(np.abs(truths[1][:3, 3]).sum() / 9)


def test_what_is_kept_is_not_measured_again(problems, tmp_path, monkeypatch):
    measured = []

    def counted(method, problems):
        measured.append(method.T)
        return {"rmse_r_deg": float(method.T)}

    monkeypatch.setattr(measurement, "measure", counted)
    weights, other = tmp_path / "a.safetensors", tmp_path / "b.safetensors"
    weights.write_bytes(b"one")
    other.write_bytes(b"two")
    kept = Kept(tmp_path / "kept")

    def ask(method=None, problems=problems, weights=weights, threads=1):
        return kept.measured("x", method or LatentCem(**SMALL), problems, weights, {"threads": threads})

    assert ask() == ({"rmse_r_deg": 3.0}, True)
    assert ask() == ({"rmse_r_deg": 3.0}, False)
    assert ask(LatentCem(**SMALL, weights="elsewhere")) == ({"rmse_r_deg": 3.0}, False), "the content counts"
    assert ask(LatentCem(**{**SMALL, "T": 4})) == ({"rmse_r_deg": 4.0}, True)
    assert ask()[1]
    assert ask(weights=other)[1]
    assert ask(threads=2)[1]
    assert ask(problems=Problems("demo@1 2", problems.pairs[:2]))[1]
    assert ask()[1]
    for damaged in ("{", "[]", json.dumps({"figures": {}})):
        (tmp_path / "kept" / "x.json").write_text(damaged)
        assert ask()[1]
    assert len(measured) == 10
    with pytest.raises(UserError, match=r"c\.safetensors: cannot be read"):
        ask(weights=tmp_path / "c.safetensors")
