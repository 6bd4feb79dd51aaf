"""Metrics that need the clouds: computed from the protocol on demand, kept, and never from other data."""

import json

import numpy as np
import pytest

from regbench.errors import UserError
from regbench.metrics.cloud import modified_chamfer, symmetry_aware_error
from regbench.registry import find_protocol
from regbench.report.cloud_metrics import CACHE
from regbench.report.table import render
from tests.report.helpers import method, motion, protocol, row, write_run

METRICS = ["symmetry_aware_error", "modified_chamfer"]
NEAR, FAR = motion((1, 0, 0)), motion((0, 60, 0))


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    problems = find_protocol("demo@1").open(tmp_path_factory.mktemp("data"))
    return problems, [problems.pair(i) for i in range(2)]


@pytest.fixture
def run(tmp_path, demo):
    problems, pairs = demo
    m = method("icp")
    p = protocol("demo@1", [pair.T_target_source for pair in pairs]) | {"data_sha256": problems.data_sha256}
    rows = [row(m, p, 0, pairs[0].T_target_source @ NEAR, time_ms=1.0), row(m, p, 1, status="timeout")]
    return write_run(tmp_path / "run", [m], [p], rows)


def figures(run, data_dir):
    (row,) = json.loads(render([run], format="json", metrics=METRICS, data_dir=data_dir))
    return [row[key] for key in METRICS]


def test_figures_are_those_of_the_pure_functions(run, demo, tmp_path):
    _, (first, second) = demo
    answers = [(first, first.T_target_source @ NEAR), (second, np.eye(4))]  # the failed trial as the identity
    symmetric = [symmetry_aware_error([T], p.T_target_source, p.source)[0] for p, T in answers]
    chamfer = [modified_chamfer([T], p.source, p.target, p.clean_source, p.clean_target)[0] for p, T in answers]
    assert figures(run, tmp_path) == pytest.approx([np.mean(symmetric), np.mean(chamfer)])


def test_they_are_kept_beside_the_run_and_not_computed_again(run, tmp_path, monkeypatch):
    before = figures(run, tmp_path)
    assert len((run / CACHE).read_text().splitlines()) == 2
    monkeypatch.setattr("regbench.report.cloud_metrics.open_problems", lambda *_: pytest.fail("computed again"))
    assert figures(run, tmp_path) == before


def test_a_changed_answer_is_computed_again(run, tmp_path):
    before = figures(run, tmp_path)
    rows = [json.loads(line) for line in (run / "trials.jsonl").read_text().splitlines()]
    rows[0]["T_target_source"] = FAR.tolist()
    (run / "trials.jsonl").write_text("".join(json.dumps(r) + "\n" for r in rows))
    after = figures(run, tmp_path)
    assert after[0] > before[0]


def test_a_damaged_cache_is_no_loss(run, tmp_path):
    before = figures(run, tmp_path)
    lines = (run / CACHE).read_text().splitlines()
    (run / CACHE).write_text(lines[0][:20] + "\n" + lines[1] + "\n[]\n")
    assert figures(run, tmp_path) == before


def test_other_data_is_refused(run, tmp_path):
    manifest = json.loads((run / "manifest.json").read_text())
    manifest["protocols"][0]["data_sha256"] = "other"
    (run / "manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(UserError, match=r"protocol demo@1: the data in .* is not the data of the run"):
        figures(run, tmp_path)


def test_other_problems_are_refused(run, tmp_path):
    rows = [json.loads(line) for line in (run / "problems.jsonl").read_text().splitlines()]
    rows[0]["T_target_source"] = np.eye(4).tolist()
    (run / "problems.jsonl").write_text("".join(json.dumps(r) + "\n" for r in rows))
    with pytest.raises(UserError, match="protocol demo@1: problem 0 is not the one that the run answered"):
        figures(run, tmp_path)


def test_a_table_that_does_not_ask_for_them_computes_nothing(run, monkeypatch):
    monkeypatch.setattr("regbench.report.cloud_metrics.open_problems", lambda *_: pytest.fail("computed"))
    for format in ("text", "csv", "markdown", "latex", "json"):
        render([run], format=format)
    assert not (run / CACHE).exists()
