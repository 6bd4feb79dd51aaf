"""What every printed table shows: columns, rows in blocks, ranks and footnotes; the formats only write it down."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import count
from typing import Any

from regbench.metrics.bootstrap import LEVEL, RESAMPLES
from regbench.metrics.table import Metric
from regbench.report.disturbed import WORDS, is_disturbed
from regbench.report.manifest import ProtocolInfo

Row = Mapping[str, Any]
BLOCKS = ("method", "published", "sentinel")
SYMBOLS = "†‡§¶"
RANKING = (
    "Best and second best are by the figures as printed, among finished rows of methods that ever answered; "
    "sentinels and published figures are not ranked."
)
# A row is marked as worse than the best of its column where p, corrected, is under this; with this sign.
SIGNIFICANT = 0.01
WORSE_SIGN = "⁻"
TESTING = (
    f"worse than the best of its column, p < {SIGNIFICANT:g}: Wilcoxon's signed-rank test on the problems, one-sided, "
    "with Holm's correction over the column."
)
INTERVALS = f"In brackets: {100 * LEVEL:g} % intervals, bootstrap over the problems, {RESAMPLES:,} resamples."
SCORING = "A failed trial is scored as the identity. Times are of the trials that answered."


@dataclass
class Notes:
    """Footnotes by text: the same text gets the same mark."""

    marks: dict[str, str] = field(default_factory=dict)

    def mark(self, text: str) -> str:
        """Return the mark of a footnote, new or known."""
        if text not in self.marks:
            n = len(self.marks)
            self.marks[text] = SYMBOLS[n] if n < len(SYMBOLS) else f"({n + 1})"
        return self.marks[text]


@dataclass(frozen=True)
class Extra:
    """A column that is no metric's and is not ranked: its key in a row, its head, and what a reader must know."""

    key: str
    name: str
    unit: str
    decimals: int
    remark: str


Column = Metric | Extra


@dataclass(frozen=True)
class Cell:
    """A figure as printed, "-" where there is none; rank 1 best, 2 second, 0 neither; marks of its footnotes.

    `worse`: than the best of its column, by more than chance. `interval`: in brackets, "" where there is none.
    """

    text: str
    rank: int = 0
    mark: str = ""
    worse: bool = False
    interval: str = ""


@dataclass(frozen=True)
class Line:
    """One row: a method, its number of trials, its figures and its failures (None: not stated)."""

    method: str
    mark: str
    block: str
    n: str
    n_mark: str
    cells: Sequence[Cell]
    failures: Mapping[str, int] | None


@dataclass(frozen=True)
class Section:
    """One protocol: its columns and its rows, blocks in the order methods, published, sentinels."""

    protocol: ProtocolInfo
    metrics: Sequence[Column]
    lines: Sequence[Line]

    @property
    def has_marks(self) -> bool:
        """Whether any figure is marked as worse than the best."""
        return any(cell.worse for line in self.lines for cell in line.cells)

    @property
    def remarks(self) -> list[str]:
        """What a reader must know of its intervals and of its columns that are no metric's."""
        has_intervals = any(cell.interval for line in self.lines for cell in line.cells)
        return [*([INTERVALS] if has_intervals else []), *(c.remark for c in self.metrics if isinstance(c, Extra))]

    def blocks(self) -> list[list[Line]]:
        """Return the rows by block, without the empty ones."""
        blocks = [[line for line in self.lines if line.block == name] for name in BLOCKS]
        return [block for block in blocks if block]


def lay_out(
    protocol: ProtocolInfo, rows: Sequence[Row], metrics: Sequence[Column], notes: Notes, *, rank_times: bool = True
) -> Section:
    """Return the section of one protocol.

    Args:
        protocol: The protocol.
        rows: Its rows, as `summarise` and `published_rows` give them.
        metrics: The columns.
        notes: Collects the footnotes.
        rank_times: False where the rows were timed on different machines.

    Raises:
        ValueError: A row belongs to another protocol.
    """
    if strange := {row["protocol"] for row in rows} - {protocol.label}:
        raise ValueError(f"rows of {min(strange)} do not belong into the columns of {protocol.label}")
    ranks = {
        metric.key: _ranks(rows, metric)
        for metric in metrics
        if isinstance(metric, Metric) and (rank_times or metric.needs != "times")
    }
    lines = [
        Line(
            method=row["method"],
            mark="".join(notes.mark(text) for text in _method_remarks(row)),
            block=block_of(row),
            n=str(row["n"]) if row["n"] >= row["planned"] else f"{row['n']} of {row['planned']}",
            n_mark="".join(notes.mark(text) for text in _trial_remarks(row)),
            cells=[
                Cell(
                    figure(row, metric),
                    ranks.get(metric.key, {}).get(position, 0),
                    _cell_mark(row, metric, notes),
                    metric.key in row.get("worse_than_best", ()),
                    _interval(row, metric),
                )
                for metric in metrics
            ],
            failures=row["failures"],
        )
        for position, row in enumerate(rows)
    ]
    return Section(protocol, metrics, sorted(lines, key=lambda line: BLOCKS.index(line.block)))


def block_of(row: Row) -> str:
    """Return the block that a row stands in: what cannot be a method's merit stands with the sentinels."""
    if row["kind"] == "published":
        return "published"
    return "sentinel" if row["kind"] == "sentinel" or row["sees_ground_truth"] else "method"


def figure(row: Row, metric: Column) -> str:
    """Return a figure as printed; a published one digit for digit."""
    value = row.get(metric.key)
    if value is None:
        return "-"
    printed: str | None = row.get("printed", {}).get(metric.key)
    return printed or f"{value:.{metric.decimals}f}"


def _interval(row: Row, metric: Column) -> str:
    ends = [row.get(f"{metric.key}_{end}") for end in ("low", "high")]
    return f"[{', '.join(f'{end:.{metric.decimals}f}' for end in ends)}]" if None not in ends else ""


def failures_in_words(failures: Mapping[str, int] | None) -> str:
    """Return the number of failures and how many of each kind."""
    if failures is None:
        return "not stated"
    kinds = ", ".join(f"{number} {status}" for status, number in failures.items())
    return f"{sum(failures.values())} ({kinds})" if kinds else "0"


def _ranks(rows: Sequence[Row], metric: Metric) -> dict[int, int]:
    """Return rank 1 or 2 by position. Equal figures, as printed, share a rank; a row alone has none."""
    values = {
        position: float(figure(row, metric))
        for position, row in enumerate(rows)
        if is_ranked(row) and row.get(metric.key) is not None
    }
    if len(values) < 2:
        return {}
    rank_of = dict(zip(sorted(set(values.values()), reverse=metric.higher_is_better), count(1), strict=False))
    return {position: rank_of[value] for position, value in values.items() if rank_of[value] <= 2}


def is_ranked(row: Row) -> bool:
    """Return whether a row is a method's, with all its trials, one of them answered: else its figures say little."""
    if block_of(row) != "method":
        return False
    failures: int = sum(row["failures"].values())
    return bool(row["n"] >= row["planned"]) and failures < row["n"]


def _method_remarks(row: Row) -> list[str]:
    """Return what a reader must know of a method."""
    remarks = ["sees the ground truth"] if row["sees_ground_truth"] else []
    if row.get("training"):
        remarks.append(f"learned: {row['training']}")
    if row.get("batch", 1) > 1:
        remarks.append(f"answered {row['batch']} problems at a time: accuracy only, no times")
    if row["kind"] == "published" and not row["impossible"] and row["note"]:
        remarks.append(row["note"])
    return remarks


def _trial_remarks(row: Row) -> list[str]:
    """Return what a reader must know of the trials that a row stands for."""
    remarks = []
    if row["n"] < row["planned"]:
        remarks.append(f"unfinished: {row['n']} of {row['planned']} trials")
    if row["n_truth"] < row["n"]:
        remarks.append(f"accuracy is over {row['n_truth']} of {row['n']} trials: the other problems' truth is unknown")
    return remarks


def _cell_mark(row: Row, metric: Column, notes: Notes) -> str:
    if row["kind"] != "published":
        times = (row.get(key) for key in ("time_median_ms", "cpu_median_ms"))
        return notes.mark(WORDS) if metric.key == "time_median_ms" and is_disturbed(*times) else ""
    if metric.key in row["impossible"]:
        return notes.mark(row["note"])
    if metric.key == "time_median_ms" and row["time_note"]:
        return notes.mark(f"as published: {row['time_note']}")
    return ""
