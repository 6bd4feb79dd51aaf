"""Figures for a printed page: what they show, how they look in grey, and that the same run gives the same bytes."""

import json
import os
import re
import subprocess
import sys
from xml.etree import ElementTree

import matplotlib
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.text import Text
from PIL import Image

from regbench.errors import UserError
from regbench.report.figures import FIGURES, draw
from regbench.report.figures.draw import draw_figure
from regbench.report.figures.kinds import KINDS
from regbench.report.figures.look import COLOURS, MOST_METHODS, WIDTHS, looks, printed_page
from regbench.report.figures.words import wrapped
from regbench.report.page_charts import charts
from regbench.report.rundata import read_run
from regbench.report.table import render
from tests.report.helpers import example_run, method, motion, protocol, row, write_run

NAMES = ("plain", "_under_score", r"$\frac{1$", "a$b_1^2$[c=%&#{},path=\\alpha,long=0.123456789,longer=0.123456789]")
CATEGORIES = ("chair", "table", "lamp")


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Four methods of awkward names and one that sees the truth on two protocols, twelve problems in three categories.

    The second method fails on two problems; errors of the others are known to the reader.
    """
    methods = [*map(method, NAMES), method("oracle", kind="sentinel", sees_ground_truth=True)]
    truths = [motion((10 + i, 0, 0), (0.1, 0, 0)) for i in range(12)]
    protocols = [protocol("demo@1", truths), protocol("modelnet40/noise-shared@1", truths)]
    rows = []
    for p in protocols:
        for k, m in enumerate(methods):
            for i, truth in enumerate(truths):
                if k == 1 and i in (3, 4):
                    rows.append(row(m, p, i, status="timeout", error="why"))
                    continue
                off = 0 if k == 4 else 0.31 * (k + 1) + 0.1 * i
                rows.append(row(m, p, i, truth @ motion((off, 0, 0), (0, off / 100, 0)), time_ms=(k + 1) * (1 + i)))
    folder = write_run(tmp_path_factory.mktemp("figures") / "run", methods, protocols, rows)
    lines = [json.loads(line) for line in (folder / "problems.jsonl").read_text().splitlines()]
    lines = [line | {"label": CATEGORIES[line["problem"] % 3]} for line in lines]
    (folder / "problems.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    return folder


@pytest.fixture
def drawn(run, tmp_path, monkeypatch):
    """Draw a figure of the run and return matplotlib's."""

    def draw_it(name, runs=None, **options):
        kept = []
        monkeypatch.setattr(draw, "save", lambda figure, out: kept.append(figure))
        draw_figure(name, runs or [run], tmp_path / "figure.pdf", **options)
        return kept[0]

    return draw_it


def words_of(figure):
    return [text for text in figure.findobj(Text) if text.get_visible() and text.get_text().strip()]


def legend_of(figure):
    return [text.get_text().replace("\n", "") for text in figure.legends[0].get_texts()]


def test_every_figure_that_is_named_is_drawn():
    assert tuple(KINDS) == FIGURES


@pytest.mark.parametrize("name", FIGURES)
def test_files_are_of_their_format_and_as_wide_as_the_column(run, tmp_path, name):
    for ending in ("pdf", "svg", "png"):
        draw_figure(name, [run], tmp_path / f"{name}.{ending}", protocols=["demo@1"])
    pdf = (tmp_path / f"{name}.pdf").read_bytes()
    assert pdf.startswith(b"%PDF-")
    width = float(re.search(rb"/MediaBox \[ 0 0 ([\d.]+) [\d.]+ \]", pdf)[1])
    assert width == pytest.approx(3.3 * 72, abs=0.01)
    assert b"/FontFile2" in pdf  # TrueType, embedded
    assert b"/Type3" not in pdf
    assert b"/Subtype /Image" not in pdf  # all of it is vectors
    assert b"CreationDate" not in pdf
    svg = ElementTree.parse(tmp_path / f"{name}.svg").getroot()
    assert svg.get("width") == "237.6pt"
    assert not list(svg.iter("{http://www.w3.org/2000/svg}image"))
    with Image.open(tmp_path / f"{name}.png") as image:
        assert image.format == "PNG"
        assert image.width == 990  # 300 dots an inch


SCRIPT = """
import hashlib, sys
from pathlib import Path
from regbench.report.figures.draw import draw_figure
for name in ("recall.pdf", "recall.svg", "pareto.pdf", "ecdf.pdf", "time.svg", "heatmap.pdf"):
    out = Path(sys.argv[2], name)
    draw_figure(out.stem, [Path(sys.argv[1])], out, protocols=["demo@1"])
    print(out.name, hashlib.sha256(out.read_bytes()).hexdigest())
"""


def test_the_same_run_gives_the_same_bytes_in_another_process(run, tmp_path):
    said = []
    for seed, zone in (("1", "UTC"), ("2", "Asia/Tokyo")):
        environment = os.environ | {"PYTHONHASHSEED": seed, "TZ": zone}
        answer = subprocess.run(
            [sys.executable, "-c", SCRIPT, run, tmp_path], env=environment, capture_output=True, text=True, timeout=120
        )
        assert answer.returncode == 0, answer.stderr
        assert "Warning" not in answer.stderr
        said.append(answer.stdout)
    assert said[0] == said[1]
    assert len(said[0].splitlines()) == 6


def luminance(colour):
    """Relative luminance by WCAG 2: what is left of a colour in grey."""
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in to_rgb(colour)]
    return float(np.dot(linear, (0.2126, 0.7152, 0.0722)))


def test_lines_are_told_apart_in_grey():
    many = looks(f"method {i}" for i in range(MOST_METHODS))
    lines = [(str(look.dash), look.marker) for look in many.values()]
    assert len(set(lines)) == MOST_METHODS, "each has a dash and a marker that no other has together"
    assert len({marker for _, marker in lines[:12]}) == 12, "a dozen differ by their markers alone"
    greys = [luminance(colour) for colour in COLOURS]
    assert all((1 + 0.05) / (grey + 0.05) > 2 for grey in greys), "each is seen on white paper"
    assert min(abs(a - b) for a, b in zip(greys, greys[1:] + greys[:1], strict=True)) > 0.15, "neighbours differ"
    with pytest.raises(UserError, match="25 methods in one figure cannot be told apart: choose up to 24"):
        looks(map(str, range(25)))


@pytest.mark.parametrize("name", ["recall", "ecdf"])
def test_each_method_s_line_has_its_look_in_every_panel_and_in_the_legend(drawn, name):
    figure = drawn(name, width="page")
    expected = [(look.colour, look.marker) for look in looks([*NAMES, "oracle"]).values()]
    for axes in figure.axes:
        assert [(line.get_color(), line.get_marker()) for line in axes.lines] == expected
        assert len({str(line._unscaled_dash_pattern) for line in axes.lines}) == 5
    handles = figure.legends[0].legend_handles
    assert [(handle.get_color(), handle.get_marker()) for handle in handles] == expected


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("name", FIGURES)
def test_no_word_is_too_small_or_cut_or_read_as_a_formula(drawn, name, width):
    figure = drawn(name, width=width)
    assert figure.get_figwidth() == WIDTHS[width]
    canvas = FigureCanvasAgg(figure)
    with printed_page():
        canvas.draw()
        box = figure.get_tightbbox(canvas.get_renderer())  # of all that is drawn, in inches
    for text in words_of(figure):
        assert not text.get_parse_math()
        assert not text.get_usetex()
        assert 6 <= text.get_fontsize() <= 8
    assert box.x0 > -0.01
    assert box.y0 > -0.01
    assert box.x1 < figure.get_figwidth() + 0.01
    assert box.y1 < figure.get_figheight() + 0.01
    abreast = len({round(axes.get_position().x0, 3) for axes in figure.axes})
    for axes in figure.axes:
        assert axes.get_window_extent().width > 0.35 * figure.bbox.width / abreast, "names leave room for what is drawn"


def test_names_stand_as_they_are_with_what_must_not_be_hidden(drawn):
    for name in ("recall", "pareto", "ecdf"):
        said = legend_of(drawn(name))
        assert said[0] == NAMES[0]
        assert said[1] == f"{NAMES[1]} (4 of 24 failed)"
        assert said[2:4] == [*NAMES[2:]]
        assert said[4] == "oracle (sees the truth)"
    for name in ("time", "heatmap"):
        text = "".join("".join(t.get_text().split()) for t in words_of(drawn(name, protocols=["demo@1"])))
        assert all("".join(part.split()) in text for part in (*NAMES, "(2 of 12 failed)", "(sees the truth)"))


def test_an_unfinished_row_is_named_as_such(drawn, tmp_path):
    said = legend_of(drawn("recall", [example_run(tmp_path / "run")]))
    assert "unfinished (2 of 8 trials)" in said
    assert "failing (7 of 8 failed)" in said


def test_what_matplotlib_was_set_to_does_not_matter_and_stays(run, tmp_path):
    draw_figure("recall", [run], tmp_path / "a.pdf")
    with matplotlib.rc_context({"text.usetex": True, "font.size": 30, "pdf.fonttype": 3, "axes.facecolor": "red"}):
        before = dict(matplotlib.rcParams)
        draw_figure("recall", [run], tmp_path / "b.pdf")
        assert dict(matplotlib.rcParams) == before
    assert (tmp_path / "a.pdf").read_bytes() == (tmp_path / "b.pdf").read_bytes()


def test_recall_is_the_share_within_both_thresholds(drawn):
    figure = drawn("recall", protocols=["demo@1"], choice=["both", "rotation", "translation"], width="page")
    off = np.array([0.31 * 3 + 0.1 * i for i in range(12)])  # of the third method: off deg and off / 100
    for axes, unit in zip(figure.axes, (1, 1, 100), strict=True):
        thresholds, shares = axes.lines[2].get_data()
        away = np.abs(thresholds[:, None] * unit - off).min(axis=1) > 1e-6
        expected = (off <= thresholds[:, None] * unit).mean(axis=1)
        np.testing.assert_allclose(shares[away], expected[away])
        assert axes.get_xlim() == (0, 15 / unit)
    assert "alone" not in figure.axes[0].get_xlabel()


def test_failures_are_scored_as_the_identity_in_curves(drawn):
    axes, _ = drawn("ecdf", protocols=["demo@1"]).axes
    x, y = axes.lines[1].get_data()
    assert y[x < 9].max() == pytest.approx(10 / 12)  # problems 3 and 4 turn by 13 and 14 deg
    assert y[-1] == 1.0


def test_the_front_is_that_of_the_page(drawn, run):
    axes = drawn("pareto", protocols=["demo@1"], metrics=["rre_mean_deg"]).axes[0]
    (page,) = [
        plane for plane in charts(read_run(run).groups[:5], read_run(run))["planes"] if plane["key"] == "rre_mean_deg"
    ]
    line, *points = axes.lines
    filled = [point.get_markerfacecolor() != "white" for point in points]
    assert filled == [point["front"] for point in page["points"]] == [True, False, False, False, False]
    for point, expected in zip(points, page["points"], strict=True):
        assert point.get_xdata()[0] == pytest.approx(expected["time_ms"], rel=1e-4)
    assert points[1].get_ydata()[0] == pytest.approx(page["points"][1]["value"], rel=1e-4)
    assert list(line.get_xdata()) == [pytest.approx(6.5)]


def test_a_box_is_of_the_times_of_the_trials_that_answered(drawn):
    axes = drawn("time", protocols=["demo@1"]).axes[0]
    medians = [line for line in axes.lines if line.get_linewidth() == 1.6]
    times = [[(k + 1) * (1 + i) for i in range(12) if not (k == 1 and i in (3, 4))] for k in range(5)]
    assert [line.get_xdata()[0] for line in medians] == [pytest.approx(np.median(some)) for some in times]


def cells_of(axes):
    return {(round(t.get_position()[1] - 0.5), round(t.get_position()[0] - 0.5)): t.get_text() for t in axes.texts}


def test_heatmap_of_protocols_has_the_tables_figures(drawn, run):
    figure = drawn("heatmap", metrics=["rre_median_deg"])
    rows = json.loads(render([run], format="json"))
    cells = cells_of(figure.axes[0])
    labels = ["demo@1", "modelnet40/noise-shared@1"]
    names = [*NAMES, "oracle"]
    assert len(cells) == len(rows) == 10
    for row_ in rows:
        place = names.index(row_["method"]), labels.index(row_["protocol"])
        assert cells[place] == f"{row_['rre_median_deg']:.3g}"


def test_heatmap_of_categories_has_each_category_s_recall(drawn):
    cells = cells_of(drawn("heatmap", protocols=["demo@1"], metrics=["recall_1deg"]).axes[0])
    # Five methods are more than three categories, and go down; categories by name.
    assert len(cells) == 15
    for column, category in enumerate(sorted(CATEGORIES)):
        members = [i for i in range(12) if CATEGORIES[i % 3] == category]
        for k in (0, 2, 3):
            hits = [0.31 * (k + 1) + 0.1 * i < 1 for i in members]
            assert cells[k, column] == {0.0: "0", 0.25: "25.0", 0.5: "50.0", 0.75: "75.0", 1.0: "100"}[np.mean(hits)]


def test_numbers_in_cells_are_read_on_their_grey(drawn):
    axes = drawn("heatmap", protocols=["demo@1"], metrics=["rre_mean_deg"]).axes[0]
    (mesh,) = axes.collections
    colours = mesh.cmap(mesh.norm(mesh.get_array())).reshape(-1, 4)
    for colour, text in zip(colours, axes.texts, strict=True):
        light, dark = sorted((luminance(colour[:3]), luminance(text.get_color())), reverse=True)
        assert (light + 0.05) / (dark + 0.05) > 4, text.get_text()


def test_what_has_no_trial_has_no_line_and_breaks_nothing(drawn, tmp_path):
    m, p = method("never"), protocol("demo@1", [motion()])
    run = write_run(tmp_path / "empty", [m, method("once")], [p], [row(method("once"), p, 0, motion(), time_ms=1.0)])
    for name in FIGURES:
        FigureCanvasAgg(drawn(name, [run])).draw()


def test_a_protocol_without_a_trial_has_no_panel(drawn, tmp_path):
    m, p, later = method("icp"), protocol("demo@1", [motion()]), protocol("later@1", [motion()])
    run = write_run(tmp_path / "run", [m], [p, later], [row(m, p, 0, motion(), time_ms=1.0)])
    figure = drawn("recall", [run])
    assert [axes.get_title() for axes in figure.axes] == ["demo@1"]
    assert legend_of(figure) == ["icp"]
    with pytest.raises(UserError, match="nothing to draw: the runs have no trial yet"):
        drawn("recall", [run], protocols=["later@1"])


@pytest.mark.parametrize("name", ["time", "pareto"])
def test_a_figure_of_times_needs_one(drawn, tmp_path, name):
    m, p = method("icp"), protocol("demo@1", [motion()])
    run = write_run(tmp_path / "run", [m], [p], [row(m, p, 0, status="timeout")])
    with pytest.raises(UserError, match=f"plot {name}: no trial here has a time: all failed"):
        drawn(name, [run])


@pytest.mark.parametrize(
    ("name", "options", "words"),
    [
        ("recall", {"metrics": ["mae_t"]}, "plot recall: --metric mae_t: it is drawn of errors, not of a metric"),
        ("recall", {"choice": ["bth"]}, "unknown --within 'bth'; did you mean 'both'?"),
        ("ecdf", {"metrics": ["recall_5deg"]}, "it is drawn of errors or times of single trials"),
        ("time", {"metrics": ["mae_t"]}, "it is drawn of times"),
        ("pareto", {"metrics": ["time_p95_ms"]}, "it is drawn of metrics of accuracy"),
        ("pareto", {"metrics": ["rre"]}, "unknown metric 'rre'"),
        ("ecdf", {"methods": ["plan"]}, "unknown method 'plan' of these runs; did you mean 'plain'?"),
        ("ecdf", {"protocols": ["demo@2"]}, "unknown protocol 'demo@2'"),
    ],
)
def test_what_cannot_be_drawn_is_one_clear_line(run, tmp_path, name, options, words):
    with pytest.raises(UserError, match=re.escape(words)):
        draw_figure(name, [run], tmp_path / "figure.pdf", **options)
    assert list(tmp_path.iterdir()) == []


def test_there_have_to_be_categories(tmp_path):
    run = example_run(tmp_path / "run")
    with pytest.raises(UserError, match="demo@1 has no categories, or one alone; leave out --by category"):
        draw_figure("heatmap", [run], tmp_path / "a.pdf", choice=["category"])


def test_what_does_not_fit_is_refused_and_fits_the_page(drawn, tmp_path):
    methods, truths = [method(f"method_{i}") for i in range(20)], [motion()] * 44
    p = protocol("demo@1", truths)
    rows = [row(m, p, i, motion(), time_ms=1.0) for m in methods for i in range(44)]
    run = write_run(tmp_path / "run", methods, [p], rows)
    lines = [json.loads(line) for line in (run / "problems.jsonl").read_text().splitlines()]
    lines = [line | {"label": f"category {line['problem'] // 2}"} for line in lines]
    (run / "problems.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    with pytest.raises(UserError, match="20 columns do not fit 3.3 inches; give --width page, or choose fewer"):
        drawn("heatmap", [run])
    assert len(drawn("heatmap", [run], width="page").axes[0].texts) == 20 * 22


def test_times_of_different_machines_are_not_drawn_together(drawn, tmp_path):
    p = protocol("demo@1", [motion()])
    runs = []
    for name in ("icp", "fgr"):
        m = method(name)
        runs.append(write_run(tmp_path / name, [m], [p], [row(m, p, 0, motion(), time_ms=1.0)], cpu=f"{name} CPU"))
    for name in ("pareto", "time"):
        with pytest.raises(UserError, match=r"times of different machines do not compare \(icp CPU, 2 cores; fgr CPU"):
            drawn(name, runs)
        drawn(name, runs, mixed=True)
    drawn("recall", runs)


@pytest.mark.parametrize("text", ["short", NAMES[-1], "x" * 50, "a, b, c, d, e, f", "", "icp[a=1,b=2]"])
@pytest.mark.parametrize("width", [1, 7, 20, 200])
def test_wrapping_loses_nothing(text, width):
    lines = wrapped(text, width).split("\n")
    assert all(len(line) <= width for line in lines)
    assert "".join(lines).replace(" ", "") == text.replace(" ", "")
