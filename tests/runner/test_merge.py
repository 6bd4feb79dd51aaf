"""Several run folders as one: every trial once, refused where they do not go together, and a run goes on with it."""

import json
import re

import pytest

from regbench.cli.main import main
from regbench.errors import UserError
from regbench.report.merge import read_runs
from regbench.report.rundata import read_run
from regbench.runner.merge import merge_runs
from tests.report.helpers import method, motion, protocol, row, write_run
from tests.runner.helpers import rows_of, run_here

TRUTHS = [motion((angle, 0, 0)) for angle in (10, 20, 30, 40)]
DEMO, ICP = protocol("demo@1", TRUTHS), method("icp")


def shard(folder, problems, *, m=ICP, p=DEMO, angle=0, **options):
    rows = [row(m, p, problem, motion((angle, 0, 0)), time_ms=1.0 + problem) for problem in problems]
    return write_run(folder, [m], [p], rows, **options)


def test_shards_of_a_real_run_are_the_run_and_it_goes_on(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    whole, _ = run_here(tmp_path / "whole", method=["identity", "random"], limit=6)
    run_here(tmp_path / "a", method=["identity"], limit=6)
    run_here(tmp_path / "b", method=["random"], limit=3)
    assert main(["merge", "a", "b", "--out", "merged"]) == 0
    assert "wrote merged: 9 trials" in capsys.readouterr().out
    answers = {r["key"]: r["T_target_source"] for r in whole}
    assert all(answers[r["key"]] == r["T_target_source"] for r in rows_of(tmp_path / "merged"))
    rows, progress = run_here(tmp_path / "merged", method=["identity", "random"], limit=6)
    assert (progress.done, progress.total) == (9, 12)
    assert {r["key"] for r in rows} == set(answers)
    assert main(["table", "merged"]) == 0


def test_a_trial_of_both_is_there_once(tmp_path):
    a, b = shard(tmp_path / "a", [0, 1, 2]), shard(tmp_path / "b", [2, 3])
    assert merge_runs([a, b], tmp_path / "c") == (4, 0)
    (group,) = read_run(tmp_path / "c").groups
    assert [problem for problem, _ in group.trials] == [0, 1, 2, 3]
    told = json.loads((tmp_path / "c" / "manifest.json").read_text())["merged_from"]
    assert [entry["folder"] for entry in told] == [str(a), str(b)]


def test_different_answers_are_named_and_the_later_can_be_taken(tmp_path):
    a, b = shard(tmp_path / "a", [0, 1]), shard(tmp_path / "b", [1], angle=5)
    with pytest.raises(UserError, match=r"icp on problem 1 of demo@1, repeat 0: .*a and .*b have different answers"):
        merge_runs([a, b], tmp_path / "c")
    assert not (tmp_path / "c").exists()
    merge_runs([a, b], tmp_path / "c", anyway=True)
    (group,) = read_run(tmp_path / "c").groups
    assert [trial.T_target_source[1][2] != 0 for trial in group.trials.values()] == [False, True]


def test_rows_that_are_out_of_date_stay_behind(tmp_path):
    a, b = shard(tmp_path / "a", [0]), shard(tmp_path / "b", [1])
    with (b / "trials.jsonl").open("a") as file:
        file.write(json.dumps(row(method("icp", version="old"), DEMO, 2, motion())) + "\n")
    assert merge_runs([a, b], tmp_path / "c") == (2, 1)


def test_two_machines_are_both_named_and_their_times_not_ranked(tmp_path, capsys):
    a, b = shard(tmp_path / "a", [0, 1]), shard(tmp_path / "b", [2, 3], cpu="Another CPU")
    merge_runs([a, b], tmp_path / "c")
    assert read_run(tmp_path / "c").machines == ["Test CPU, 2 cores", "Another CPU, 2 cores"]
    assert main(["table", str(tmp_path / "c")]) == 0
    assert re.search(r"Test CPU.*Another CPU", capsys.readouterr().out, re.DOTALL)
    merge_runs([tmp_path / "c", shard(tmp_path / "d", [0])], tmp_path / "e")
    assert len(read_run(tmp_path / "e").machines) == 2


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"seed": 3}, "--seed: 0 in .*a, 3 in .*b"),
        ({"threads": 2}, "--threads: 1 in .*a, 2 in .*b"),
        ({"m": method("icp", version="2")}, "method icp: another in .*b"),
        ({"p": protocol("demo@1", TRUTHS, data="other")}, "protocol demo@1: other problems in .*b"),
    ],
)
def test_what_does_not_go_together_is_refused(tmp_path, options, words):
    a, b = shard(tmp_path / "a", [0]), shard(tmp_path / "b", [1], **options)
    with pytest.raises(UserError, match=words):
        merge_runs([a, b], tmp_path / "c")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "b"]


@pytest.mark.parametrize(
    ("file", "text", "words"),
    [
        ("manifest.json", "[]", "manifest.json: is not a run's manifest"),
        (
            "manifest.json",
            '{"config": {"seed": 0, "threads": 1, "device": "cpu"}}',
            "manifest.json: is not a run's manifest",
        ),
        ("trials.jsonl", "{}\n", "line 1 is not a trial"),
        ("trials.jsonl", '{"key":"a"}\n', "line 1 is not a trial (has no 'method')"),
        ("problems.jsonl", "1\n", "line 1 is not a problem"),
    ],
)
def test_a_damaged_folder_is_one_clear_line(tmp_path, capsys, file, text, words):
    a, b = shard(tmp_path / "a", [0]), shard(tmp_path / "b", [1])
    (b / file).write_text(text)
    assert main(["merge", str(a), str(b), "--out", str(tmp_path / "c")]) == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "b"]


def test_folders_that_differ_in_a_truth_are_refused(tmp_path):
    a, b = shard(tmp_path / "a", [0]), shard(tmp_path / "b", [1])
    lines = [json.loads(line) for line in (b / "problems.jsonl").read_text().splitlines()]
    lines[2]["T_target_source"] = motion((1, 2, 3)).tolist()
    (b / "problems.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    with pytest.raises(UserError, match=r"b/problems.jsonl: line 3 has another T_target_source"):
        merge_runs([a, b], tmp_path / "c")
    with pytest.raises(UserError, match=r"b/problems.jsonl: problem 2 of demo@1 has another T_target_source"):
        read_runs([a, b])


def test_a_folder_that_is_there_is_left_alone(tmp_path, capsys):
    a = shard(tmp_path / "a", [0])
    assert main(["merge", str(a), "--out", str(a)]) == 2
    assert "exists already" in capsys.readouterr().err
    assert main(["merge", str(a), "--out", str(a / "trials.jsonl" / "x")]) == 2
    assert main(["merge", str(a), "--out", str(tmp_path / ("x" * 500))]) == 2
