"""regbench show: the right pairs, pictures whose colours are the distances, files that nothing can misname."""

import json

import numpy as np
import pytest
from PIL import Image

from regbench.cli.main import main
from regbench.protocols.demo import DEMO
from regbench.report.distance_picture import RAMP, colours, distance_picture, nearest_distances
from regbench.report.show import Shown, shown_pairs
from tests.report.helpers import example_run, method, motion, protocol, row, write_run

RNG = np.random.default_rng(0)
ANGLES = [5, 1, 4, 2, 3]


@pytest.fixture
def run(tmp_path):
    """`near` is off by ANGLES on the first five problems of demo@1 and fails on the sixth."""
    problems = DEMO.open(tmp_path)
    pairs = [problems.pair(i) for i in range(6)]
    near = method("near")
    p = protocol("demo@1", [pair.T_target_source for pair in pairs])
    rows = [
        row(near, p, i, pairs[i].T_target_source @ motion((angle, 0, 0)), time_ms=1.0) for i, angle in enumerate(ANGLES)
    ]
    run = write_run(tmp_path / "run", [near], [p], [*rows, row(near, p, 5, status="timeout")])
    lines = [json.loads(line) for line in (run / "problems.jsonl").read_text().splitlines()]
    named = [line | {"label": pair.label, "id": pair.id} for line, pair in zip(lines, pairs, strict=True)]
    (run / "problems.jsonl").write_text("".join(json.dumps(line) + "\n" for line in named))
    return run


def test_pairs_are_listed_worst_first_and_a_failed_one_is_not(run):
    shown = list(shown_pairs(run, worst=3, median=1, best=2))
    assert [(s.kind, s.rank, s.problem) for s in shown] == [
        ("worst", 1, 0),
        ("worst", 2, 2),
        ("worst", 3, 4),
        ("median", 1, 4),
        ("best", 1, 1),
        ("best", 2, 3),
    ]
    assert shown[0].rotation_error_deg == pytest.approx(5)


def test_the_verb_lists_and_saves(run, tmp_path, capsys):
    assert main(["show", str(run), "--method", "near", "--worst", "2"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 2
    assert lines[0].startswith("near on demo@1, worst 1: problem 0 (")
    assert "off by 5 deg and " in lines[0]
    assert main(["show", str(run), "--best", "1", "--png", str(tmp_path / "new" / "png")]) == 0
    (file,) = (tmp_path / "new" / "png").iterdir()
    assert str(file) in capsys.readouterr().out
    with Image.open(file) as image:
        assert (image.format, image.size) == ("PNG", (1200, 646))


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--method", "naer"], "did you mean 'near'"),
        (["--worst", "0"], "nothing to show"),
        (["--worst", "-1"], "--worst"),
        (["--png", "/dev/null/x"], "/dev/null/x: cannot be made"),
    ],
)
def test_bad_input_is_one_line(run, capsys, more, words):
    assert main(["show", str(run), *more]) == 2
    said = capsys.readouterr().err
    assert said.startswith("regbench: ")
    assert said.count("\n") == 1
    assert words in said


def test_a_run_whose_problems_have_changed_is_refused(tmp_path, capsys):
    assert main(["show", str(example_run(tmp_path / "run")), "--method", "icp", "--protocol", "demo@1"]) == 2
    assert "is not the one that the run answered" in capsys.readouterr().err


def test_colours_follow_the_distance_from_dark_to_light():
    points, others = RNG.normal(size=(200, 3)), RNG.normal(size=(90, 3))
    brute = np.linalg.norm(points[:, None] - others, axis=2).min(axis=1)
    np.testing.assert_allclose(nearest_distances(points, others), brute)
    shades = colours(np.linspace(0, 1, 200)) @ [0.299, 0.587, 0.114]
    assert (np.diff(shades) > 0).all()  # so that the order is seen in grey
    np.testing.assert_array_equal(colours(np.array([0.0, 1.0, 7.0])), RAMP[[0, -1, -1]])


def test_what_is_aligned_is_dark_and_what_is_off_is_light():
    source = RNG.normal(size=(400, 3))
    T = motion((0, 0, 70), (9, 0, 0))
    target = source @ T[:3, :3].T + T[:3, 3]
    pixels = np.asarray(distance_picture(source, target, T, "words")).astype(int)[60:600]

    def near(panel, colour):
        """Pixels of this hue, whatever their shade: their share of red over blue is the colour's."""
        return (
            (panel[..., 2] > panel[..., 0] + 30) if colour == "dark" else (panel[..., 0] > panel[..., 2] + 60)
        ).sum()

    before, after = pixels[:, :590], pixels[:, 610:]
    assert near(before, "light") > 1000
    assert near(before, "dark") < 100
    assert near(after, "dark") > 1000
    assert near(after, "light") == 0


def test_whatever_a_method_is_called_its_file_stays_in_the_folder():
    def shown(name):
        return Shown(name, "pairs:../x", "worst", 1, 0, None, 0.0, 0.0, lambda: None).file_name

    names = [shown(name) for name in ("../../a/b", "a[b=1]", "a[b-1]", "a" * 500, "<script>", "é\n")]
    assert len(set(names)) == len(names)
    for name in names:
        assert set(name) <= set("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789.-")
        assert not name.startswith(".")
        assert len(name) < 200
