"""render(): options, ranks, and what no table can hide."""

import csv
import io
import json
import re

import pytest

from regbench.errors import UserError
from regbench.metrics.table import METRICS
from regbench.report.layout import Notes, lay_out
from regbench.report.rundata import read_run
from regbench.report.summary import summarise
from regbench.report.table import FORMATS, find_metrics, render
from tests.report.helpers import example_run, method, motion, protocol, row, write_run


@pytest.fixture
def run(tmp_path):
    return example_run(tmp_path / "run")


@pytest.mark.parametrize("format", FORMATS)
def test_failures_are_shown_whatever_is_asked_for(run, format):
    text = render([run], format=format, metrics=["mae_t"], protocols=["demo@1"])
    if format == "csv":
        (failing,) = [r for r in csv.DictReader(io.StringIO(text)) if r["method"] == "failing"]
        assert [failing[f"failures_{kind}"] for kind in ("invalid", "timeout", "crashed", "oom")] == [
            "1",
            "2",
            "1",
            "0",
        ]
        assert (failing["n"], failing["failures"]) == ("4", "4")
    elif format == "json":
        (failing,) = [r for r in json.loads(text) if r["method"] == "failing"]
        assert (failing["n"], failing["failures"]) == (4, {"invalid": 1, "timeout": 2, "crashed": 1})
    else:
        flat = " ".join(text.split())
        for kind in ("1 invalid", "2 timeout", "1 crashed"):
            assert kind in flat


@pytest.mark.parametrize("format", ["text", "markdown", "latex"])
def test_an_unfinished_row_is_marked(run, format):
    assert "unfinished: 2 of 4 trials" in render([run], format=format)


@pytest.mark.parametrize("format", ["text", "markdown", "latex"])
def test_a_row_that_saw_the_truth_is_marked(run, format):
    text = render([run], format=format, protocols=["demo@1"])
    assert "‡ sees the ground truth" in text or r"$^{\ddagger}$ sees the ground truth" in text
    (oracle,) = [line for line in text.splitlines() if "oracle" in line]
    assert "oracle‡" in oracle or r"oracle$^{\ddagger}$" in oracle


def test_text_fits_120_characters(run):
    for line in render([run], format="text", paper=True).splitlines():
        assert len(line) <= 120, line


def test_a_name_too_long_for_the_page_is_not_cut(tmp_path):
    long = method("icp[" + ",".join(f"parameter_{i}={i}" for i in range(9)) + "]")
    p = protocol("demo@1", [motion()])
    run = write_run(tmp_path, [long, method("fgr")], [p], [row(long, p, 0, motion(), time_ms=1.0)])
    text = render([run], format="text")
    assert long["method"] in text
    assert all(len(line) <= 120 for line in text.splitlines() if "parameter" not in line)


def ranks_of(run, metric, protocol_id="demo@1"):
    data = read_run(run)
    (info,) = {group.protocol for group in data.groups if group.protocol.id == protocol_id}
    rows = [row for row in summarise(data) if row["protocol"] == protocol_id]
    section = lay_out(info, rows, find_metrics([metric]), Notes())
    return {line.method: line.cells[0].rank for line in section.lines if line.cells[0].rank}


def test_ties_share_the_best_rank_and_second_is_the_next_figure(run):
    assert ranks_of(run, "rmse_r_deg") == {"icp": 1, "icp[max_distance=0.5]": 1, "od_d%[a&b=#1,c={x}]": 2}


def test_best_is_the_highest_recall_and_the_lowest_time(run):
    assert ranks_of(run, "recall_15deg", "modelnet40/clean@1")["icp"] == 1
    assert ranks_of(run, "time_median_ms") == {"od_d%[a&b=#1,c={x}]": 1, "icp": 2}


def test_sentinels_unfinished_rows_and_rows_that_never_answered_have_no_rank(run):
    for metric in ("rmse_r_deg", "rmse_t", "mae_t", "recall_5deg", "time_median_ms"):
        assert not {"oracle", "identity", "unfinished", "failing"} & set(ranks_of(run, metric))


def test_a_method_alone_is_not_called_best(tmp_path):
    m, p = method("icp"), protocol("demo@1", [motion()])
    run = write_run(tmp_path, [m], [p], [row(m, p, 0, motion(), time_ms=1.0)])
    assert ranks_of(run, "rmse_r_deg") == {}


def test_the_paper_s_rows_are_never_ranked(run):
    text = render([run], format="text", paper=True, protocols=["modelnet40/clean@1"])
    published = [line for line in text.splitlines() if "(paper)" in line]
    assert len(published) == 9
    assert not any("*" in line or "+" in line for line in published)
    assert all(line.endswith("not stated") for line in published)


def test_cells_that_cannot_hold_are_marked(tmp_path):
    m, p = method("icp"), protocol("7scenes/clean@1", [motion()], published="7scene")
    run = write_run(tmp_path, [m], [p], [row(m, p, 0, motion(), time_ms=1.0)])
    for format in ("text", "markdown"):
        text = render([run], format=format, paper=True)
        (line,) = [line for line in text.splitlines() if "LatentCEM (paper)" in line]
        assert all(re.search(rf"{figure}[†‡§¶(]", line) for figure in ("0.0066", "0.0030", "0.000015", "0.000004"))
        assert "cannot hold: RMSE(R) / MAE(R) = 440" in text
    (line,) = [line for line in text.splitlines() if "FGR (paper)" in line]
    assert not re.search("[†‡§¶]", line)


def test_a_row_of_another_protocol_is_refused_in_a_column_group(run):
    data = read_run(run)
    info = data.groups[0].protocol
    with pytest.raises(ValueError, match="rows of modelnet40/clean@1 do not belong into the columns of demo@1"):
        lay_out(info, summarise(data), find_metrics(["mae_t"]), Notes())


def test_times_of_different_machines_are_not_ranked(tmp_path):
    p = protocol("demo@1", [motion()])
    runs = []
    for name, time_ms in (("icp", 1.0), ("fgr", 2.0)):
        m = method(name)
        runs.append(write_run(tmp_path / name, [m], [p], [row(m, p, 0, motion(), time_ms=time_ms)], cpu=f"{name} CPU"))
    one = " ".join(render(runs, format="text", metrics=["time_median_ms"]).split())
    assert "Measured on icp CPU, 2 cores. Times of 1 rows from fgr CPU, 2 cores are left out (--mixed" in one
    text = render(runs, format="text", metrics=["time_median_ms"], mixed=True)
    assert "icp CPU, 2 cores; fgr CPU, 2 cores. Times of different machines do not compare" in " ".join(text.split())
    assert "1.000*" not in text


@pytest.mark.parametrize("format", ["text", "markdown", "latex"])
def test_a_time_that_its_core_was_shared_in_is_marked(tmp_path, format):
    p = protocol("demo@1", [motion()] * 3)
    methods, rows = [], []
    for name, wall in (("alone", 10.2), ("disturbed", 20.0)):
        methods.append(method(name))
        rows += [row(methods[-1], p, number, motion(), time_ms=wall, cpu_ms=10.0) for number in range(3)]
    text = render([write_run(tmp_path, methods, [p], rows)], format=format, metrics=["time_median_ms", "cpu_median_ms"])
    assert " ".join(text.split()).count("over 1.25 times the CPU time: something else used its core") == 1
    sign = {"text": "†", "markdown": "†", "latex": r"$^{\dagger}$"}[format]
    marked = [time for time in ("10.000", "10.200", "20.000") if re.search(rf"{time}[^|&\s]*{re.escape(sign)}", text)]
    assert marked == ["20.000"]


def test_rows_of_one_run_that_name_two_machines_are_timed_on_the_commoner(tmp_path):
    m, p = method("icp"), protocol("demo@1", [motion()] * 3)
    rows = [row(m, p, number, motion(), time_ms=time_ms) for number, time_ms in enumerate((1.0, 5.0, 900.0))]
    for each, machine in zip(rows, ("A, 2 cores", "A, 2 cores", "B, 8 cores"), strict=True):
        each["machine"] = machine
    run = write_run(tmp_path, [m], [p], rows)
    text = " ".join(render([run], format="text", metrics=["time_median_ms", "recall_5deg"]).split())
    assert "icp 3 3.000 1.0000" in text
    assert "Measured on A, 2 cores. Times of 1 rows from B, 8 cores are left out" in text
    mixed = " ".join(render([run], format="text", metrics=["time_median_ms"], mixed=True).split())
    assert "icp 3 5.000" in mixed
    assert "Measured on A, 2 cores; B, 8 cores." in mixed


def test_stale_rows_are_spoken_of(tmp_path):
    m, p = method("icp"), protocol("demo@1", [motion()])
    run = write_run(tmp_path, [m], [p], [row(method("icp", version="0"), p, 0, motion())])
    assert "1 rows of methods or protocols that have changed since are left out" in render([run], format="text")


def test_json_is_the_rows_and_csv_has_every_figure_in_full(run):
    rows = json.loads(render([run], format="json"))
    assert [{key: row[key] for key in row if key != "worse_than_best"} for row in rows] == summarise(read_run(run))
    table = list(csv.DictReader(io.StringIO(render([run], format="csv"))))
    assert [r["method"] for r in table] == [r["method"] for r in rows]
    for line, expected in zip(table, rows, strict=True):
        assert line["rmse_r_deg"] == ("" if expected["rmse_r_deg"] is None else repr(expected["rmse_r_deg"]))


@pytest.fixture
def clear_run(tmp_path):
    """Forty trials: `good` and `as_good` are near the truth, `bad` is farther off on each, `seldom` on one alone."""
    methods = [method(name) for name in ("good", "as_good", "bad", "seldom")] + [method("sentinel", kind="sentinel")]
    p = protocol("demo@1", [motion()] * 40)
    angles = {"good": lambda i: 1 + i / 100, "as_good": lambda i: 1 + (39 - i) / 100, "bad": lambda i: 2 + i / 100}
    angles |= {"seldom": lambda i: 90 if i == 7 else 1 + i / 100, "sentinel": lambda i: 40}
    rows = [row(m, p, i, motion((angles[m["method"]](i), 0, 0)), time_ms=1.0) for m in methods for i in range(40)]
    return write_run(tmp_path, methods, [p], rows)


@pytest.mark.parametrize(("format", "sign"), [("text", "⁻"), ("markdown", "⁻"), ("latex", "$^{-}$")])
def test_a_figure_worse_than_the_best_by_more_than_chance_is_marked(clear_run, format, sign):
    text = render([clear_run], format=format, metrics=["mae_r_deg"])
    marked = [name for name in ("as_good", "bad", "seldom", "sentinel") for line in text.splitlines()
              if line.replace("\\", "").lstrip("| ").startswith(name) and sign in line]  # fmt: skip
    assert marked == ["bad"], "one bad trial of forty may be chance, and sentinels are not tested"
    assert "Wilcoxon's signed-rank test" in " ".join(text.split())


def test_csv_and_json_name_the_metrics_in_which_a_row_is_worse(clear_run):
    rows = {row["method"]: row["worse_than_best"] for row in json.loads(render([clear_run], format="json"))}
    assert {"rmse_r_deg", "mae_r_deg", "rre_median_deg"} <= set(rows["bad"])
    assert all(0 < p < 0.01 for p in rows["bad"].values())
    assert rows["good"] == rows["as_good"] == rows["seldom"] == rows["sentinel"] == {}
    table = {line["method"]: line for line in csv.DictReader(io.StringIO(render([clear_run], format="csv")))}
    assert table["bad"]["worse_than_best"].split() == list(rows["bad"])


def test_repeats_are_no_more_evidence_than_one_trial(tmp_path):
    """Five problems cannot tell two methods apart at p < 0.01, however often each is answered alike."""
    methods = [method("good"), method("bad")]
    p = protocol("demo@1", [motion()] * 5)
    rows = [
        row(m, p, i, motion((k + 1 + i / 10, 0, 0)), repeat=r, time_ms=1.0)
        for k, m in enumerate(methods)
        for i in range(5)
        for r in range(10)
    ]
    run = write_run(tmp_path, methods, [p], rows, repeat=10)
    assert [row["worse_than_best"] for row in json.loads(render([run], format="json"))] == [{}, {}]


def test_every_figure_has_an_interval_that_holds_it(run):
    plain = json.loads(render([run], format="json"))
    rows = json.loads(render([run], format="json", with_intervals=True))
    assert [{k: v for k, v in found.items() if not k.endswith(("_low", "_high"))} for found in rows] == plain
    for found in rows:
        for key in METRICS:
            ends = found.get(f"{key}_low"), found.get(f"{key}_high")
            if found.get(key) is None:
                assert ends == (None, None)
            else:
                assert ends[0] - 1e-9 <= found[key] <= ends[1] + 1e-9
    table = list(csv.DictReader(io.StringIO(render([run], format="csv", with_intervals=True))))
    columns = list(table[0])
    assert columns[columns.index("mae_t") :][:3] == ["mae_t", "mae_t_low", "mae_t_high"]
    for line, found in zip(table, rows, strict=True):
        assert line["mae_t_high"] == ("" if found.get("mae_t_high") is None else repr(found["mae_t_high"]))


@pytest.mark.parametrize("format", ["text", "markdown", "latex"])
def test_printed_intervals_stand_in_brackets_and_the_paper_has_none(run, format):
    text = render([run], format=format, with_intervals=True, paper=True, protocols=["modelnet40/clean@1"])
    text = text.replace("\\[", "[").replace("\\]", "]").replace("{[}", "[").replace("{]}", "]")
    assert re.search(r"1\.1547[*}]* ?[^\n]{0,14}\[1\.1547, 1\.1547\]", text)
    assert "95 % intervals, bootstrap over the problems" in " ".join(text.replace("\\%", "%").split())
    assert not any("[" in line for line in text.splitlines() if "(paper)" in line)
    assert "bootstrap" not in render([run], format=format)


def test_the_same_trials_give_the_same_intervals(run):
    options = {"format": "csv", "metrics": ["rmse_r_deg", "rre_p95_deg"], "with_intervals": True}
    assert render([run], **options) == render([run], **options)


def test_how_often_a_row_is_better_than_the_best_one(tmp_path):
    methods = [method("best"), method("ahead_at_times"), method("oracle", kind="sentinel", sees_ground_truth=True)]
    p = protocol("demo@1", [motion()] * 8)
    # Better on the first three, equal on the next two.
    angles = {"best": [5] * 8, "ahead_at_times": [1, 1, 1, 5, 5, 20, 20, 20], "oracle": [0] * 8}
    rows = [row(m, p, i, motion((angles[m["method"]][i], 0, 0)), time_ms=1.0) for m in methods for i in range(8)]
    run = write_run(tmp_path, methods, [p], rows)
    found = {
        row["method"]: row["improvement_rre_mean_deg"]
        for row in json.loads(render([run], format="json", improvement="rre_mean_deg"))
    }
    assert found == {"best": 0.5, "ahead_at_times": 0.5, "oracle": 1.0}
    rows = json.loads(render([run], format="json", improvement="recall_15deg"))
    assert [row["improvement_recall_15deg"] for row in rows] == [0.5, 0.5 * 5 / 8, 0.5]
    text = render([run], format="text", improvement="rre_mean_deg")
    assert "P(better): share of trials on which a row is better in RRE mean than the best row" in " ".join(text.split())
    with pytest.raises(UserError, match="unknown metric 'rre'"):
        render([run], format="text", improvement="rre")


def test_no_sign_no_note(run):
    assert "Wilcoxon" not in render([run], format="text")


def test_chosen_methods_and_protocols_and_columns(run):
    text = render([run], format="csv", methods=["icp"], protocols=["demo@1"], metrics=["mae_t", "recall_1deg"])
    (line,) = csv.DictReader(io.StringIO(text))
    assert (line["method"], line["protocol"]) == ("icp", "demo@1")
    assert "rmse_t" not in line
    assert list(line)[12:14] == ["mae_t", "recall_1deg"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"format": "html"}, "unknown format 'html'"),
        ({"metrics": ["rmse"]}, "unknown metric 'rmse'"),
        ({"methods": ["icpp"]}, "unknown method 'icpp' of these runs; did you mean 'icp'"),
        ({"protocols": ["demo@2"]}, "unknown protocol 'demo@2' of these runs; did you mean 'demo@1'"),
        ({"paper": True, "protocols": ["demo@1"]}, "the paper has no figures for demo@1; leave out --paper"),
    ],
)
def test_bad_options_are_one_clear_line(run, options, message):
    with pytest.raises(UserError, match=message):
        render([run], **{"format": "text", **options})


def test_markdown_cells_are_as_many_as_columns(run):
    for line in render([run], format="markdown", paper=True, protocols=["modelnet40/clean@1"]).splitlines():
        if line.startswith("|"):
            assert len(re.findall(r"(?<!\\)\|", line)) == 10


def latex_rows(text):
    body = text.split(r"\toprule")[1].split(r"\bottomrule")[0]
    return [line for line in body.splitlines() if line.endswith(r"\\")]


def test_latex_is_balanced_and_escaped(run):
    text = render([run], format="latex")
    assert re.findall(r"\\begin\{(\w+\*?)\}", text) == re.findall(r"\\end\{(\w+\*?)\}", text)[::-1]
    bare = re.sub(r"\\[\\{}_%&#$]", "", text)
    assert bare.count("{") == bare.count("}")
    assert bare.count("$") % 2 == 0
    assert "_" not in bare
    assert "#" not in bare
    assert r"od\_d\%{[}a\&b=\#1,c=\{x\}{]} &" in text
    (columns,) = re.findall(r"\\begin\{tabular\}\{(\w+)\}", text)
    for line in latex_rows(text)[1:]:
        assert len(re.findall(r"(?<!\\)&", line)) == len(columns) - 1
    assert not re.search(r"\\\\\s*\[", text)


def test_latex_marks_best_and_second_and_no_sentinel(run):
    lines = {line.split(" & ")[0]: line for line in latex_rows(render([run], format="latex", protocols=["demo@1"]))}
    assert r"\textbf{1.1547}" in lines["icp"]
    assert r"\textbf{1.1547}" in lines[r"icp{[}max\_distance=0.5{]}"]
    assert r"\underline{3.4641}" in lines[r"od\_d\%{[}a\&b=\#1,c=\{x\}{]}"]
    apart = [line for name, line in lines.items() if name.startswith(("oracle", "identity", "unfinished"))]
    assert len(apart) == 3
    assert not any("textbf" in line or "underline" in line for line in apart)


def test_latex_has_dashes_where_a_method_was_not_run(tmp_path):
    demo, other = protocol("demo@1", [motion()]), protocol("other@1", [motion()])
    runs = [
        write_run(tmp_path / "a", [method("icp")], [demo], [row(method("icp"), demo, 0, motion())]),
        write_run(tmp_path / "b", [method("fgr")], [other], [row(method("fgr"), other, 0, motion())]),
    ]
    lines = latex_rows(render(runs, format="latex"))
    assert lines[2].startswith("icp & 0.0000")
    assert lines[2].endswith(r"& 0 & -- & -- & -- & -- & -- \\")
    assert lines[3].startswith("fgr & -- & -- & -- & -- & -- & 0.0000")


@pytest.mark.parametrize("format", FORMATS)
def test_how_a_learned_method_was_trained_is_said_in_every_format(tmp_path, format):
    learned = method("idam", kind="learned") | {"training": "supervised, 64,000 samples, 1.2 h on Test CPU"}
    p = protocol("demo@1", [motion()])
    methods = [learned, method("fgr")]
    run = write_run(tmp_path, methods, [p], [row(m, p, 0, motion(), time_ms=1.0) for m in methods])
    text = render([run], format=format)
    assert text.count("supervised, 64,000 samples, 1.2 h on Test CPU") == 1
