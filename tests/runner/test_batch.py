"""--batch: several problems at once, without times, in rows and tables that say so and mix with no others."""

import numpy as np
import pytest

from regbench.errors import UserError
from regbench.report.table import render
from regbench.runner.merge import merge_runs
from tests.runner.helpers import run_here

METHODS = """
import os
import signal

import numpy as np
from regbench import Registration


def answer(problem):
    T = np.eye(4)
    T[:3, 3] = problem.target.mean(axis=0) - problem.source.mean(axis=0)
    return Registration(T_target_source=T)


class Alone:
    name = "alone"

    def register(self, problem):
        return answer(problem)


class Together:
    name = "together"

    def register(self, problem):
        return answer(problem)

    def register_batch(self, problems):
        return [Registration(T_target_source=answer(p).T_target_source, iterations=len(problems)) for p in problems]


class Picky(Together):
    name = "picky"

    def skip(self, problem):
        return "too far right" if problem.target[:, 0].mean() > 0 else None


class Forgetful(Together):
    name = "forgetful"

    def register_batch(self, problems):
        return []


class Fatal(Together):
    name = "fatal"

    def register_batch(self, problems):
        os.kill(os.getpid(), signal.SIGSEGV)


class Raises(Together):
    name = "raises_in_batches"

    def register(self, problem):
        if problem.target[:, 0].mean() > 0:
            raise RuntimeError("no")
        return answer(problem)

    def register_batch(self, problems):
        return [self.register(problem) for problem in problems]
"""


@pytest.fixture
def plugin(tmp_path):
    path = tmp_path / "batches.py"
    path.write_text(METHODS)
    return str(path)


def by_problem(rows, method):
    return {row["problem"]: row for row in rows if row["method"] == method}


def test_answers_are_the_same_and_no_row_of_a_batch_has_a_time(tmp_path, plugin):
    rows, _ = run_here(tmp_path / "run", method=["alone,together"], limit=30, batch=8, plugin=[plugin])
    alone, together = by_problem(rows, "alone"), by_problem(rows, "together")
    assert len(alone) == len(together) == 30
    for problem, row in together.items():
        assert row["T_target_source"] == alone[problem]["T_target_source"]
        assert row["time_ms"] is row["cpu_ms"] is None
        assert row["iterations"] == row["batch"]
        assert alone[problem]["time_ms"] > 0, "a method that takes no batches is timed as ever"
        assert "batch" not in alone[problem]
    assert {row["batch"] for row in together.values()} == {1, 5, 8}  # 25 = 3 x 8 + 1, and 5
    text = render([tmp_path / "run"], format="text")
    assert "answered 8 problems at a time: accuracy only, no times" in " ".join(text.split())


def test_a_skip_is_its_own_problems(tmp_path, plugin):
    rows, _ = run_here(tmp_path / "run", method=["picky"], limit=25, batch=25, plugin=[plugin])
    assert {row["status"] for row in rows} == {"ok", "skipped"}
    asked = sum(row["status"] == "ok" for row in rows)
    assert {row["iterations"] for row in rows if row["status"] == "ok"} == {asked}


@pytest.mark.parametrize("method", ["forgetful", "fatal"])
def test_a_batch_that_fails_is_run_one_by_one(tmp_path, plugin, method):
    rows, _ = run_here(tmp_path / "run", method=[method], limit=6, batch=4, plugin=[plugin])
    assert [(row["status"], row["batch"], row["time_ms"]) for row in rows] == [("ok", 1, None)] * 6


def test_one_bad_problem_costs_its_own_row_alone(tmp_path, plugin):
    rows, _ = run_here(tmp_path / "run", method=["raises_in_batches"], limit=20, batch=5, plugin=[plugin])
    wrong = [row["status"] == "error" for row in rows]
    assert 0 < sum(wrong) < 20
    alone, _ = run_here(tmp_path / "alone", method=["raises_in_batches"], limit=20, plugin=[plugin])
    assert wrong == [row["status"] == "error" for row in alone]


def test_batches_and_single_pairs_do_not_mix(tmp_path, plugin):
    options = {"method": ["together"], "limit": 4, "plugin": [plugin]}
    single, _ = run_here(tmp_path / "single", **options)
    batched, _ = run_here(tmp_path / "batched", batch=4, **options)
    assert not {row["key"] for row in single} & {row["key"] for row in batched}
    with pytest.raises(UserError, match="--batch 1, this one has --batch 4"):
        run_here(tmp_path / "single", batch=4, **options)
    folders = [tmp_path / "single", tmp_path / "batched"]
    with pytest.raises(UserError, match="--batch"):
        merge_runs(folders, tmp_path / "merged")
    with pytest.raises(UserError, match="batch 4"):
        render(folders, format="text")
    mixed = render(folders, format="text", mixed=True)
    assert "together (seed 0, threads 1, device cpu, batch 4)" in " ".join(mixed.split())


@pytest.mark.parametrize("method", ["idam", "rpmnet", "pointnetlk", "fmr", "dcp"])
def test_the_learned_methods_answer_batches_as_they_answer_pairs(tmp_path, method):
    options = {"method": [method], "limit": 4, "plugin": []}
    single, _ = run_here(tmp_path / "single", **options)
    batched, _ = run_here(tmp_path / "batched", batch=4, **options)
    assert {row["batch"] for row in batched} == {4}
    for one, other in zip(single, batched, strict=True):
        np.testing.assert_allclose(one["T_target_source"], other["T_target_source"], atol=1e-4)
