import csv

import pytest

from regbench.errors import UserError
from regbench.learning.training.log import TrainingLog
from regbench.learning.training.plot import plot_training


def row(step, **more):
    return {"step": step, "seconds": step / 2, "learning_rate": 0.1, "loss.a": 1 / step, **more}


def read(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture
def path(tmp_path):
    log = TrainingLog(tmp_path / "log.csv")
    log.add(row(10))
    log.add(row(20, **{"validation.error": 3.0}))
    log.add(row(30, **{"loss.b": 2.0}))
    return tmp_path / "log.csv"


def test_columns_come_in_a_fixed_order_and_late_ones_have_empty_cells_before(path):
    table = read(path)
    assert list(table[0]) == ["step", "seconds", "learning_rate", "loss.a", "loss.b", "validation.error"]
    assert [line["validation.error"] for line in table] == ["", "3", ""]
    assert [line["loss.b"] for line in table] == ["", "", "2"]


def test_a_continued_log_drops_what_is_done_again(path):
    log = TrainingLog(path, until=20)
    assert [int(line["step"]) for line in read(path)] == [10, 20]
    log.add(row(30))
    assert [int(line["step"]) for line in read(path)] == [10, 20, 30]
    assert log.rows[1]["validation.error"] == 3.0


def test_half_a_row_at_the_end_is_dropped(path):
    path.write_text(path.read_text() + "40,20,0.1,0.0")
    assert [row["step"] for row in TrainingLog(path, until=40).rows] == [10, 20, 30]


@pytest.mark.parametrize("text", ["a,b\n1,2\n", "step\nfive\n", "step,seconds\n1,2,3,4\n"])
def test_a_file_that_is_no_log_is_refused(path, text):
    path.write_text(text)
    with pytest.raises(UserError, match=r"log\.csv: is not a training's log"):
        TrainingLog(path, until=100)


def test_the_picture_takes_any_figures(tmp_path):
    rows = [row(10, **{"validation.x": -1.0}), row(20, **{"validation.x": float("nan"), "loss.b": 0.0})]
    plot_training(rows, tmp_path / "losses.png")
    assert (tmp_path / "losses.png").read_bytes().startswith(b"\x89PNG")
    plot_training([{"step": 1, "seconds": 0.1, "learning_rate": 1.0}], tmp_path / "none.png")
    assert not (tmp_path / "none.png").exists()
