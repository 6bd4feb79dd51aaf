"""Several runs in one table: joined where they compare, refused where they do not."""

import pytest

from regbench.errors import UserError
from regbench.report.merge import read_runs
from regbench.report.summary import summarise
from tests.report.helpers import method, motion, protocol, row, write_run

TRUTHS = [motion((angle, 0, 0)) for angle in (10, 20, 30)]


def run_of(folder, methods, p, *, answer=TRUTHS, **options):
    rows = [row(m, p, i, answer[i], time_ms=1.0) for m in methods for i in range(p["n"])]
    return write_run(folder, methods, [p], rows, **options)


def test_methods_of_two_runs_stand_under_one_protocol(tmp_path):
    p = protocol("demo@1", TRUTHS)
    runs = [run_of(tmp_path / name, [method(name)], p) for name in ("icp", "fgr")]
    rows = summarise(read_runs(runs))
    assert [(row["method"], row["protocol"], row["n"]) for row in rows] == [("icp", "demo@1", 3), ("fgr", "demo@1", 3)]


def test_the_later_run_s_trial_counts(tmp_path):
    p, m = protocol("demo@1", TRUTHS), method("icp")
    wrong = run_of(tmp_path / "a", [m], p, answer=[motion()] * 3)
    right = run_of(tmp_path / "b", [m], protocol("demo@1", TRUTHS, n=2), answer=TRUTHS)
    (first,) = summarise(read_runs([wrong, right]))
    assert (first["n"], first["rre_mean_deg"]) == (3, pytest.approx(10))  # 0, 0 and 30 deg
    (second,) = summarise(read_runs([right, wrong]))
    assert second["rre_mean_deg"] == pytest.approx(20)


def test_a_shorter_run_beside_a_longer_one_is_unfinished(tmp_path):
    short = run_of(tmp_path / "a", [method("icp")], protocol("demo@1", TRUTHS, n=1))
    long = run_of(tmp_path / "b", [method("fgr")], protocol("demo@1", TRUTHS))
    rows = summarise(read_runs([short, long]))
    assert [(row["n"], row["planned"]) for row in rows] == [(1, 3), (3, 3)]


@pytest.mark.parametrize(
    ("other_protocol", "other_method", "message"),
    [
        (protocol("demo@2", TRUTHS), method("fgr"), "protocol 'demo' is demo@1 in .*a and demo@2 in .*b"),
        (protocol("demo@1", TRUTHS, data="other"), method("fgr"), "protocol 'demo@1' is content .* in .*a and content"),
        (protocol("demo@1", TRUTHS), method("icp", version="2"), "method 'icp' is fingerprint .*a and fingerprint .*b"),
    ],
)
def test_what_does_not_compare_is_refused_unless_mixed(tmp_path, other_protocol, other_method, message):
    runs = [
        run_of(tmp_path / "a", [method("icp")], protocol("demo@1", TRUTHS)),
        run_of(tmp_path / "b", [other_method], other_protocol),
    ]
    with pytest.raises(UserError, match=message + ".*their rows do not compare"):
        read_runs(runs)
    rows = summarise(read_runs(runs, mixed=True))
    assert [row["n"] for row in rows] == [3, 3]
    assert len({(row["method"], row["protocol"]) for row in rows}) == 2


@pytest.mark.parametrize("setting", ["seed", "threads"])
def test_one_method_with_other_settings_is_not_overwritten(tmp_path, setting):
    """Half of the trials of one run under half of another's would be a row that nobody ran."""
    runs = [
        run_of(tmp_path / "a", [method("icp")], protocol("demo@1", TRUTHS), answer=[motion()] * 3),
        run_of(tmp_path / "b", [method("icp")], protocol("demo@1", TRUTHS, n=2), **{setting: 2}),
    ]
    with pytest.raises(UserError, match=rf"'icp on demo@1' is .*in .*a and .*{setting} 2.* in .*b.*do not compare"):
        read_runs(runs)
    rows = summarise(read_runs(runs, mixed=True))
    assert [(row["n"], row["rre_mean_deg"]) for row in rows] == [(3, pytest.approx(20)), (2, pytest.approx(0))]
    assert all(name in row["method"] for row, name in zip(rows, (f"{setting} ", f"{setting} 2"), strict=True))


def test_other_settings_on_another_protocol_are_no_clash(tmp_path):
    runs = [run_of(tmp_path / "a", [method("icp")], protocol("demo@1", TRUTHS))]
    runs += [run_of(tmp_path / "b", [method("icp")], protocol("other@1", TRUTHS), seed=1)]
    assert [row["method"] for row in summarise(read_runs(runs))] == ["icp", "icp"]


def test_mixed_content_of_one_protocol_stays_in_sections_of_its_own(tmp_path):
    protocols = [protocol("demo@1", TRUTHS), protocol("demo@1", TRUTHS, data="other")]
    runs = [run_of(tmp_path / str(i), [method("icp")], p) for i, p in enumerate(protocols)]
    rows = summarise(read_runs(runs, mixed=True))
    assert [row["protocol"] for row in rows] == [f"demo@1#{p['sha256'][:8]}" for p in protocols]


def test_two_versions_in_one_run_are_refused_too(tmp_path):
    protocols = [protocol("demo@1", TRUTHS), protocol("demo@2", TRUTHS)]
    run = write_run(tmp_path, [method("icp")], protocols, [])
    with pytest.raises(UserError, match="protocol 'demo' is demo@1"):
        read_runs([run])


def test_no_run_is_an_error():
    with pytest.raises(UserError, match="no run given"):
        read_runs([])
