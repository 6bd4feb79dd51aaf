"""Two runs against each other: differences, intervals, refusals, and the conditions of CI."""

import csv
import io
import json
import re

import numpy as np
import pytest
from scipy import stats

from regbench.cli.main import main
from regbench.metrics.table import find_metrics
from regbench.report.comparison import compare, incomparable
from regbench.report.fail_if import parse_condition
from regbench.report.rundata import read_run
from tests.report.helpers import method, motion, protocol, row, write_run

N = 60
TRUTHS = [motion((10, 20, 30))] * N
DEMO = protocol("demo@1", TRUTHS)


def turned(degrees):
    return [motion((10, 20, 30)) @ motion((angle, 0, 0)) for angle in degrees]


@pytest.fixture
def errors():
    """The first run's angles and the second's: 40 % of trials turned by 1 degree less, others as they were."""
    before = np.random.default_rng(0).uniform(2, 8, N)
    after = before - np.where(np.arange(N) % 5 < 2, 1.0, 0.0)
    return before, after


def run_of(folder, degrees, *, m=None, p=DEMO, time_ms=1.0, failed=(), **options):
    m = m or method("icp")
    rows = [
        row(m, p, i, status="timeout") if i in failed else row(m, p, i, T, time_ms=time_ms * (1 + i % 7 / 100))
        for i, T in enumerate(turned(degrees))
    ]
    return write_run(folder, [m], [p], rows, **options)


def test_differences_and_intervals_are_scipys(tmp_path, errors):
    before, after = errors
    runs = [read_run(run_of(tmp_path / name, degrees)) for name, degrees in zip("ab", errors, strict=True)]
    (found,) = compare(*runs, find_metrics(["rre_mean_deg", "rre_median_deg"]))
    mean, median = found.differences
    assert (mean.before, mean.after) == (pytest.approx(before.mean()), pytest.approx(after.mean()))
    assert median.change == pytest.approx(np.median(after) - np.median(before))
    reference = stats.bootstrap(
        (before, after),
        lambda x, y, axis: y.mean(axis=axis) - x.mean(axis=axis),
        paired=True,
        n_resamples=10_000,
        method="percentile",
        rng=np.random.default_rng(1),
    ).confidence_interval
    assert (mean.low, mean.high) == pytest.approx((reference.low, reference.high), abs=0.02)  # steps of 1 / N
    assert (mean.verdict, found.n, found.has_changed) == ("better", N, False)


def test_a_run_compared_with_itself_is_the_same(tmp_path, errors):
    run = read_run(run_of(tmp_path / "a", errors[0]))
    (found,) = compare(run, run, find_metrics(["rmse_r_deg", "recall_5deg", "time_median_ms"]))
    assert [difference.verdict for difference in found.differences] == ["same"] * 3


def test_what_chance_explains_is_not_shown(tmp_path):
    rng = np.random.default_rng(3)
    runs = [read_run(run_of(tmp_path / name, rng.uniform(2, 8, N))) for name in "ab"]
    (found,) = compare(*runs, find_metrics(["rre_mean_deg"]))
    assert found.differences[0].verdict == "no difference shown"


def test_repeats_of_a_problem_are_no_more_evidence_than_one(tmp_path, errors):
    def repeated(name, degrees, repeat):
        rows = [row(method("icp"), DEMO, i, T, repeat=r) for i, T in enumerate(turned(degrees)) for r in range(repeat)]
        return read_run(write_run(tmp_path / f"{name}{repeat}", [method("icp")], [DEMO], rows, repeat=repeat))

    metrics = find_metrics(["rre_mean_deg"])
    once, ten_times = (
        compare(repeated("a", errors[0], repeat), repeated("b", errors[1], repeat), metrics)[0].differences[0]
        for repeat in (1, 10)
    )
    assert (ten_times.n, once.n) == (10 * N, N)
    assert (ten_times.low, ten_times.high) == pytest.approx((once.low, once.high), rel=1e-9)


def test_failures_count_as_the_identity_and_are_counted(tmp_path, errors):
    before = run_of(tmp_path / "a", errors[0])
    after = run_of(tmp_path / "b", errors[0], failed=range(20))
    (found,) = compare(read_run(before), read_run(after), find_metrics(["rre_mean_deg", "time_median_ms"]))
    assert (found.failures_before, found.failures_after) == (0, 20)
    assert found.differences[0].verdict == "worse"
    assert [difference.n for difference in found.differences] == [N, N - 20]  # a failed trial has an error, no time


@pytest.mark.parametrize(
    ("text", "exit_code"),
    [
        ("rre_mean_deg falls by 0.3", 1),
        ("rre_mean_deg falls by 5%", 1),
        ("rre_mean_deg falls by 0.5", 0),  # it falls by 0.4
        ("rre_mean_deg grows by 0", 0),
        ("failures grows by 1", 0),
        ("time grows by 1%", 0),
    ],
)
def test_conditions_and_exit_codes(tmp_path, capsys, errors, text, exit_code):
    folders = [str(run_of(tmp_path / name, degrees)) for name, degrees in zip("ab", errors, strict=True)]
    assert main(["compare", *folders, "--fail-if", text]) == exit_code
    assert (f"fails: {text}: icp on demo@1" in capsys.readouterr().err) == bool(exit_code)


def test_noise_alone_does_not_fail_and_a_failed_trial_does(tmp_path, capsys):
    rng = np.random.default_rng(5)
    first, second = rng.uniform(2, 8, N), rng.uniform(2, 8, N)
    if second.mean() < first.mean():
        first, second = second, first
    before, after = run_of(tmp_path / "a", first), run_of(tmp_path / "b", second)
    assert main(["compare", str(before), str(after), "--fail-if", "rre_mean_deg grows by 0.001"]) == 0
    broken = run_of(tmp_path / "c", first, failed=[3])
    assert main(["compare", str(before), str(broken), "--fail-if", "failures grows by 1"]) == 1
    assert "failures 0 -> 1 of 60" in capsys.readouterr().err


def test_shares_of_zero_and_binary_fractions():
    assert parse_condition("failures grows by 10%").reached(0, 1)
    assert not parse_condition("failures grows by 10%").reached(0, 0)
    assert parse_condition("recall drops by 0.01").reached(0.29, 0.28)
    assert parse_condition("recall drops by 0.01").reached(0.95, 0.94)
    assert not parse_condition("recall drops by 0.01").reached(0.95, 0.941)
    assert not parse_condition("time grows by 20%").reached(10, 8)
    assert parse_condition("time  grows by 20 %").reached(10, 12)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("recall gets worse", "expected 'METRIC drops|falls|grows|rises by NUMBER"),
        ("recall drops by -1", "expected 'METRIC drops"),
        ("speed drops by 1", "no metric 'speed'; there are recall, time, .*rmse_r_deg"),
    ],
)
def test_a_condition_that_is_none_is_one_clear_line(tmp_path, capsys, errors, text, words):
    folder = str(run_of(tmp_path / "a", errors[0]))
    assert main(["compare", folder, folder, "--fail-if", text]) == 2
    assert re.search(words, capsys.readouterr().err)


def test_a_condition_that_could_never_fail_is_refused(tmp_path, capsys, errors):
    folder = str(run_of(tmp_path / "a", errors[0], time_ms=np.nan, failed=range(N)))
    assert main(["compare", folder, folder, "--fail-if", "time grows by 20%"]) == 2
    assert "no method has it in both runs" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"p": protocol("demo@1", TRUTHS, data="other")}, "demo@1 has other problems in the second run"),
        ({"p": protocol("demo@2", TRUTHS)}, "only the first run has icp on demo@1"),
        ({"m": method("fgr")}, "only the first run has icp on demo@1"),
        ({"threads": 4}, "times of .*threads .* and of .*threads 4"),
        ({"cpu": "Another"}, "times of .*, and of Another, "),
    ],
)
def test_what_does_not_compare_is_refused_and_named(tmp_path, errors, capsys, options, words):
    before, after = run_of(tmp_path / "a", errors[0]), run_of(tmp_path / "b", errors[1], **options)
    assert main(["compare", str(before), str(after)]) == 2
    said = capsys.readouterr().err
    assert re.search(f"do not compare: {words}", said)
    assert said.count("\n") == 1
    shown = main(["compare", str(before), str(after), "--anyway"])
    if "only the first" in words:
        assert (shown, "no method has a trial of the same problem" in capsys.readouterr().err) == (2, True)
    else:
        assert (shown, "asked for anyway" in capsys.readouterr().out) == (0, True)
    timed = options.keys() & {"threads", "cpu"}
    assert main(["compare", str(before), str(after), "--metric", "recall_5deg"]) == (0 if timed else 2)


def test_another_seed_compares(tmp_path, errors):
    runs = [read_run(run_of(tmp_path / "a", errors[0])), read_run(run_of(tmp_path / "b", errors[0], seed=9))]
    assert incomparable(*runs, find_metrics(["time_median_ms"])) == []


def test_two_methods_of_one_run(tmp_path, errors, capsys):
    icp, fgr = method("icp"), method("fgr")
    rows = [row(icp, DEMO, i, T, time_ms=2.0) for i, T in enumerate(turned(errors[0]))]
    rows += [row(fgr, DEMO, i, T, time_ms=1.0) for i, T in enumerate(turned(errors[1]))]
    folder = str(write_run(tmp_path / "a", [icp, fgr], [DEMO], rows))
    arguments = ["compare", folder, folder, "--method", "icp", "--against", "fgr", "--format", "json"]
    assert main([*arguments, "--metric", "rre_mean_deg,time_median_ms"]) == 0
    records = json.loads(capsys.readouterr().out)
    assert [(record["method"], record["verdict"]) for record in records] == [("icp -> fgr", "better")] * 2
    assert main(["compare", folder, folder, "--against", "fgr"]) == 2
    assert "name the one method" in capsys.readouterr().err


def test_formats_have_the_same_figures(tmp_path, errors, capsys):
    folders = [str(run_of(tmp_path / name, degrees)) for name, degrees in zip("ab", errors, strict=True)]
    changed = str(run_of(tmp_path / "c", errors[1], m=method("icp", version="2")))
    printed = {}
    for name in ("text", "markdown", "csv", "json"):
        assert main(["compare", folders[0], changed, "--format", name, "--out", str(tmp_path / name)]) == 0
        printed[name] = (tmp_path / name).read_text()
    records = json.loads(printed["json"])
    for record, line in zip(records, csv.DictReader(io.StringIO(printed["csv"])), strict=True):
        assert float(line["change"]) == record["change"]
    (record,) = (record for record in records if record["metric"] == "mae_r_deg")
    for name in ("text", "markdown"):
        assert f"{record['before']:.4f}" in printed[name]
        assert "icp (changed)" in printed[name]
    assert capsys.readouterr().out == ""


def test_a_run_that_was_cut_short_does_not_pass(tmp_path, errors, capsys):
    a, b = (run_of(tmp_path / name, degrees) for name, degrees in zip("ab", errors, strict=True))
    rows = (b / "trials.jsonl").read_text().splitlines(keepends=True)
    (b / "trials.jsonl").write_text("".join(rows[:7]))
    gate = ["compare", str(a), str(b), "--metric", "mae_r_deg", "--fail-if", "failures grows by 1"]
    assert main(gate) == 2
    assert f"the second run is unfinished: 7 of {N} trials of icp on demo@1" in capsys.readouterr().err
    assert main(["compare", str(b), str(a)]) == 2
    assert f"the first run is unfinished: 7 of {N} trials of icp on demo@1" in capsys.readouterr().err
    assert main([*gate, "--anyway"]) == 0
    assert f"7 trials are in both runs, of {N} and 7." in capsys.readouterr().out


def test_a_run_of_fewer_problems_says_how_many_are_compared(tmp_path, errors, capsys):
    a = run_of(tmp_path / "a", errors[0])
    b = run_of(tmp_path / "b", errors[1][:9], p=DEMO | {"n": 9})
    assert main(["compare", str(a), str(b), "--metric", "mae_r_deg"]) == 0
    assert f"demo@1: 9 trials are in both runs, of {N} and 9." in capsys.readouterr().out
    assert main(["compare", str(a), str(b), "--metric", "mae_r_deg", "--format", "json"]) == 0
    (record,) = json.loads(capsys.readouterr().out)
    assert (record["n"], record["trials_before"], record["trials_after"]) == (9, N, 9)


def test_times_of_a_shared_core_are_named(tmp_path, errors, capsys):
    a, b = (run_of(tmp_path / name, degrees) for name, degrees in zip("ab", errors, strict=True))
    rows = [json.loads(line) for line in (b / "trials.jsonl").read_text().splitlines()]
    for each in rows:
        each["time_ms"] = 2 * each["cpu_ms"]
    (b / "trials.jsonl").write_text("".join(json.dumps(each) + "\n" for each in rows))
    words = "demo@1: times of icp in one of the runs are over 1.25 times the CPU time"
    assert main(["compare", str(a), str(b), "--metric", "time_median_ms"]) == 0
    assert words in " ".join(capsys.readouterr().out.split())
    assert main(["compare", str(a), str(b), "--metric", "time_median_ms", "--format", "json"]) == 0
    assert json.loads(capsys.readouterr().out)[0]["times_disturbed"] is True
    assert main(["compare", str(a), str(b), "--metric", "mae_r_deg"]) == 0
    assert words not in " ".join(capsys.readouterr().out.split())


def test_a_method_that_no_longer_answers_fails_a_condition_on_time(tmp_path, errors, capsys):
    a = run_of(tmp_path / "a", errors[0])
    b = run_of(tmp_path / "b", errors[1], failed=range(N))
    assert main(["compare", str(a), str(b), "--fail-if", "time grows by 20%"]) == 1
    assert f"icp on demo@1, no time in the second run: all {N} trials failed" in capsys.readouterr().err


def test_a_truth_that_was_changed_is_refused(tmp_path, errors, capsys):
    a, b = (run_of(tmp_path / name, degrees) for name, degrees in zip("ab", errors, strict=True))
    lines = [json.loads(line) for line in (b / "problems.jsonl").read_text().splitlines()]
    lines[4]["T_target_source"] = motion((1, 2, 3)).tolist()
    (b / "problems.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    assert main(["compare", str(a), str(b)]) == 2
    assert "problem 4 of demo@1 has another ground truth in the second run" in capsys.readouterr().err
