"""Reading run folders: what counts as a trial, what is stale, and files that are not a run's."""

import json

import numpy as np
import pytest

from regbench.errors import UserError
from regbench.report.rundata import read_run
from regbench.report.summary import summarise
from tests.report.helpers import example_run, method, motion, protocol, row, write_run


@pytest.fixture
def truths():
    return [motion((10, 0, 0)), motion((20, 0, 0))]


def test_the_last_row_of_a_trial_wins(tmp_path, truths):
    m, p = method("icp"), protocol("demo@1", truths)
    rows = [row(m, p, 0, status="timeout"), row(m, p, 1, truths[1]), row(m, p, 0, truths[0], time_ms=3.0)]
    (group,) = read_run(write_run(tmp_path, [m], [p], rows)).groups
    assert [trial.status.value for trial in group.trials.values()] == ["ok", "ok"]
    assert group.trials[0, 0].time_ms == 3.0


def test_trials_are_in_the_order_of_problem_and_repeat(tmp_path, truths):
    m, p = method("icp"), protocol("demo@1", truths)
    rows = [row(m, p, i, truths[i], repeat=r) for r in (1, 0) for i in (1, 0)]
    (group,) = read_run(write_run(tmp_path, [m], [p], rows, repeat=2)).groups
    assert list(group.trials) == [(0, 0), (0, 1), (1, 0), (1, 1)]
    assert group.planned == 4


def test_stale_rows_are_left_out_and_counted(tmp_path, truths):
    m, p = method("icp"), protocol("demo@1", truths)
    rows = [
        row(method("icp", version="0"), p, 0, truths[0]),
        row(m, protocol("demo@1", truths, data="other"), 1, truths[1]),
        row(method("gone"), p, 0, truths[0]),
        row(m, protocol("gone@1", truths), 0, truths[0]),
    ]
    run = read_run(write_run(tmp_path, [m], [p], rows))
    assert [len(group.trials) for group in run.groups] == [0]
    assert run.stale == 4


def test_a_failed_trial_holds_the_identity_whatever_the_row_says(tmp_path, truths):
    m, p = method("icp"), protocol("demo@1", truths)
    rows = [row(m, p, 0, np.full((4, 4), 7.0), status="invalid"), row(m, p, 1, status="error")]
    (group,) = read_run(write_run(tmp_path, [m], [p], rows)).groups
    assert all(np.array_equal(trial.T_target_source, np.eye(4)) for trial in group.trials.values())


def test_a_torn_last_line_is_not_fatal(tmp_path):
    run = example_run(tmp_path)
    whole = summarise(read_run(run))
    with (run / "trials.jsonl").open("a") as file:
        file.write('{"key": "torn')
    assert summarise(read_run(run)) == whole


@pytest.mark.parametrize("name", ["manifest.json", "trials.jsonl", "problems.jsonl"])
def test_a_missing_file_is_named(tmp_path, name):
    run = example_run(tmp_path)
    (run / name).unlink()
    with pytest.raises(UserError, match=rf"{name}: cannot be read \(No such file"):
        read_run(run)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("manifest.json", "", r"manifest.json: is not JSON"),
        ("manifest.json", '{"methods": [', r"manifest.json: is not JSON"),
        ("manifest.json", "[]", r"manifest.json: is not a run's manifest"),
        ("manifest.json", '{"name": "a foreign file"}', r"manifest.json: is not a run's manifest \(has no 'methods'\)"),
        ("manifest.json", "\x00\xff", r"manifest.json: is not JSON"),
        ("trials.jsonl", "nonsense\n", r"trials.jsonl: line 1 is not a trial"),
        ("trials.jsonl", '{"key": "a"}\n', r"trials.jsonl: line 1 is not a trial \(has no 'method'\)"),
        ("problems.jsonl", "nonsense\n", r"problems.jsonl: line 1 is not a problem"),
        ("problems.jsonl", "[1]\n", r"problems.jsonl: line 1 is not a problem"),
        ("problems.jsonl", "", r"problems.jsonl: has no problem 0 of demo@1, which trials.jsonl answers"),
        (
            "problems.jsonl",
            '{"protocol": "demo@1", "problem": 0, "T_target_source": [[1, 0], [0, 1]]}\n',
            r"problems.jsonl: line 1: T_target_source is not a motion: shape \(2, 2\)",
        ),
    ],
)
def test_a_damaged_or_foreign_file_is_one_clear_line(tmp_path, name, content, message):
    run = example_run(tmp_path)
    (run / name).write_text(content)
    with pytest.raises(UserError, match=message) as caught:
        read_run(run)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"status": "perhaps"}, "'perhaps' is not a valid Status"),
        ({"T_target_source": None}, "status ok without a 4x4 T_target_source"),
        ({"T_target_source": [[1, 0], [0, 1]]}, "status ok without a 4x4 T_target_source"),
        ({"T_target_source": [[float("nan")] * 4] * 4}, "T_target_source is not a motion: has values that are not"),
        ({"T_target_source": np.diag([0.1, 1, 1, 1]).tolist()}, "T_target_source is not a motion: its rotation"),
        ({"time_ms": -5.0}, "a negative time"),
        ({"T_target_source": [["a"] * 4] * 4}, "must be real number"),
        ({"problem": "first"}, "invalid literal"),
        ({"time_ms": "fast"}, "could not convert string to float"),
        ({"method": ["icp"]}, "unhashable"),
    ],
)
def test_a_damaged_row_is_named_by_its_line(tmp_path, truths, change, message):
    m, p = method("icp"), protocol("demo@1", truths)
    rows = [row(m, p, 0, truths[0]), row(m, p, 1, truths[1]) | change]
    run = write_run(tmp_path, [m], [p], rows)
    with pytest.raises(UserError, match=rf"trials.jsonl: line 2 is not a trial \(.*{message}"):
        read_run(run)


@pytest.mark.parametrize(
    ("place", "value", "reason"),
    [
        ((0, 0), float("nan"), "has values that are not finite"),
        ((1, 3), float("inf"), "has values that are not finite"),
        ((0, 0), 1.01, "its rotation is not orthonormal"),
        ((slice(0, 3), 2), [0, 0, -1], "its rotation is a reflection"),
        ((3, 0), 0.5, "its last row is not 0 0 0 1"),
        ((0, 3), -1e101, "longer than any"),
    ],
)
def test_a_truth_that_is_no_motion_is_named_by_its_line(tmp_path, truths, place, value, reason):
    run = write_run(tmp_path, [method("icp")], [protocol("demo@1", truths)], [])
    T = np.eye(4)
    T[place] = value
    with (run / "problems.jsonl").open("a") as file:
        file.write(json.dumps({"protocol": "demo@1", "problem": 2, "T_target_source": T.tolist()}) + "\n")
    with pytest.raises(UserError, match=rf"problems.jsonl: line 3: T_target_source is not a motion: {reason}"):
        read_run(run)


def test_a_truth_that_is_rigid_but_for_rounding_is_taken_as_it_is(tmp_path, truths):
    run = write_run(tmp_path, [method("icp")], [protocol("demo@1", truths)], [])
    T = motion((10, 20, 30))
    T[0, 0] += 4e-5
    with (run / "problems.jsonl").open("a") as file:
        file.write(json.dumps({"protocol": "demo@1", "problem": 2, "T_target_source": T.tolist()}) + "\n")
    (found,) = read_run(run).truths.values()
    assert found[2].tobytes() == T.tobytes()


def test_a_folder_that_is_no_run(tmp_path):
    with pytest.raises(UserError, match=r"manifest.json: cannot be read .* is this the folder of a run\?"):
        read_run(tmp_path / "nowhere")


@pytest.mark.parametrize("part", ["methods", "protocols"])
def test_a_name_that_a_terminal_would_obey_is_refused(tmp_path, part):
    run = example_run(tmp_path)
    manifest = json.loads((run / "manifest.json").read_text())
    manifest[part][0][{"methods": "method", "protocols": "id"}[part]] = "red\x1b[31m"
    (run / "manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(UserError, match=r"has control characters: 'red\\x1b\[31m'"):
        read_run(run)


def test_a_manifest_of_another_shape(tmp_path):
    run = example_run(tmp_path)
    manifest = json.loads((run / "manifest.json").read_text())
    manifest["protocols"][0]["n"] = None
    (run / "manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(UserError, match="is not a run's manifest"):
        read_run(run)
