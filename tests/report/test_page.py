"""The page without a browser: whole, closed to the network, nothing from outside gets through as markup, small."""

import json
import re

import numpy as np
import pytest

from regbench.errors import UserError
from regbench.report.page import report_page
from tests.report.helpers import example_run, method, motion, protocol, row, write_run

EVIL = "</script><script>alert(1)</script><img src=x onerror=alert(2)>"


def data_of(page):
    return json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)[1])


def test_the_page_has_every_section_and_says_why_there_are_no_pairs(tmp_path):
    page, left_out = report_page([example_run(tmp_path / "run")])
    for words in ("demo@1", "modelnet40/clean@1", "od_d%[a&amp;b=#1,c={x}]", "unfinished", "Test CPU", "timeout"):
        assert words in page
    assert len(left_out) == 2  # the example's problems are of no protocol that regbench can open
    assert all("no pairs to look at" in words for words in left_out)
    assert [section["views"] for section in data_of(page)["protocols"]] == [None, None]


def test_curves_are_those_of_the_trials(tmp_path):
    page, _ = report_page([example_run(tmp_path / "run")], protocols=["demo@1"])
    (section,) = data_of(page)["protocols"]
    charts = {entry["name"]: entry for entry in section["charts"]["methods"]}
    # icp is off by 2 deg about x each time and not in translation.
    degrees = np.array(section["charts"]["thresholds_deg"])
    away = np.abs(degrees - 2) > 1e-9
    recall = np.array(charts["icp"]["recall"]["rotation"])
    np.testing.assert_array_equal(recall[away], (degrees > 2)[away].astype(float))
    assert charts["icp"]["time_ms"][3] == 2.5
    assert charts["failing"]["time_ms"] is None
    # failing is scored as the identity: off by 10, 20, 30, 40 deg.
    np.testing.assert_allclose(charts["failing"]["ecdf"]["rotation"], [[10, 20, 30, 40], [0.25, 0.5, 0.75, 1]])
    plane = next(plane for plane in section["charts"]["planes"] if plane["key"] == "rre_median_deg")
    # The oracle sees the truth: it is neither on the front nor does it keep others off.
    assert {point["name"] for point in plane["points"] if point["front"]} == {"unfinished", "identity"}


def test_nothing_loads_from_elsewhere_and_the_policy_forbids_it(tmp_path):
    page, _ = report_page([example_run(tmp_path / "run")])
    policy = re.search(r'http-equiv="Content-Security-Policy" content="([^"]*)"', page)[1]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    assert not re.search(r"(src|href)\s*=\s*[\"'](?!#)", page)
    assert not re.search(r"@import|url\(", page)
    assert set(re.findall(r"https?://[^\s\"'<]+", page)) <= {"http://www.w3.org/2000/svg"}


def test_what_comes_from_outside_is_text_never_markup(tmp_path):
    truths = [motion((10, 0, 0)), motion((20, 0, 0))]
    evil = method(f"evil[{EVIL}]") | {"training": EVIL, "parameters": {EVIL: EVIL}, "version": EVIL}
    p = protocol(f"demo{EVIL}@1", truths) | {"description": EVIL}
    rows = [row(evil, p, 0, truths[0], time_ms=1.0), row(evil, p, 1, status="error", error=EVIL)]
    run = write_run(tmp_path / "<b>run&", [evil], [p], rows, cpu=EVIL)
    problems = [json.loads(line) for line in (run / "problems.jsonl").read_text().splitlines()]
    for i, problem in enumerate(problems):
        problem |= {"label": f"{EVIL}{i}", "id": EVIL}
    (run / "problems.jsonl").write_text("".join(json.dumps(problem) + "\n" for problem in problems))
    page, _ = report_page([run])
    assert page.count("<script") == 2  # the data and the script
    assert page.count("</script") == 2
    assert "<img" not in page
    assert "<b>run" not in page
    assert page.count("&lt;script&gt;alert(1)") > 5
    assert data_of(page)["methods"] == [evil["method"]]


def test_categories_and_pairs_of_a_real_protocol(tmp_path):
    from regbench.protocols.demo import DEMO

    problems = DEMO.open(tmp_path)
    pairs = [problems.pair(i) for i in range(6)]
    near = method("near")
    p = protocol("demo@1", [pair.T_target_source for pair in pairs])
    angles = [5, 1, 4, 2, 3, 0]
    rows = [
        row(near, p, i, pair.T_target_source @ motion((angle, 0, 0)), time_ms=1.0)
        for i, (pair, angle) in enumerate(zip(pairs, angles, strict=True))
    ]
    run = write_run(tmp_path / "run", [near], [p], rows)
    lines = [json.loads(line) for line in (run / "problems.jsonl").read_text().splitlines()]
    lines = [line | {"label": pair.label, "id": pair.id} for line, pair in zip(lines, pairs, strict=True)]
    (run / "problems.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    page, left_out = report_page([run])
    assert left_out == []
    assert "By category" in page
    views = data_of(page)["protocols"][0]["views"]
    assert [(pair["kind"], pair["problem"]) for pair in views["pairs"]] == [
        ("worst", 0),
        ("worst", 2),
        ("worst", 4),
        ("median", 3),
        ("best", 5),
    ]
    assert views["pairs"][0]["rotation_deg"] == pytest.approx(5)
    assert set(views["clouds"]) == {"0", "2", "4", "3", "5"}


def test_the_same_runs_give_the_same_page(tmp_path):
    run = example_run(tmp_path / "run")
    assert report_page([run]) == report_page([run])


def test_a_damaged_run_is_refused_in_one_line(tmp_path):
    run = example_run(tmp_path / "run")
    (run / "problems.jsonl").write_text("nonsense\n")
    with pytest.raises(UserError, match=r"problems.jsonl: line 1 is not a problem"):
        report_page([run])
