"""A published table again: methods on protocols, and our figures beside the printed ones, row by row."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from regbench.errors import UserError
from regbench.files import write_atomically
from regbench.report.published import published_rows, published_times
from regbench.report.table import render
from regbench.runner.journal import Row
from regbench.runner.plan import RunConfig
from regbench.runner.run import Tally, run
from regbench.runner.rundir import RunDir
from regbench.runner.status import Status

# As the paper's Table 1 has them.
CELLS = {"rmse_r_deg": "RMSE(R)", "rmse_t": "RMSE(t)", "mae_r_deg": "MAE(R)", "mae_t": "MAE(t)"}
DIGITS = {"mae_t": 5}


@dataclass(frozen=True)
class Part:
    """A part of a table: one run.

    Attributes:
        name: Of its folder.
        protocols: Ids by the column group of the paper that they stand for.
        methods: Ours, as they are asked for, by the name of the paper's row; "" for rows that the paper has not.
    """

    name: str
    protocols: Mapping[str, str]
    methods: Mapping[str, Sequence[str]]


class _Lines:
    """A run's progress as lines."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self._failed: set[tuple[str, str]] = set()

    def start(self, run: RunDir, trials: Mapping[str, Tally]) -> None:
        self._total = sum(tally.total for tally in trials.values())
        self._done = sum(tally.done for tally in trials.values())
        self._next = self._done
        self._say(f"{run.path}: {self._total} trials, {self._done} of them done before")

    def row(self, row: Row) -> None:
        self._done += 1
        if row["status"] != Status.OK and (row["method"], row["status"]) not in self._failed:
            self._failed.add((row["method"], row["status"]))
            self._say(f"{row['status']}: {row['method']} on {row['protocol']}: {row['error']} (more are in the table)")
        if self._done >= self._next + max(1, self._total // 20):
            self._next = self._done
            self._say(f"{self._done} of {self._total} trials, at {row['method']} on {row['protocol']}")

    def note(self, message: str) -> None:
        self._say(message)


def run_part(
    part: Part,
    out: Path,
    *,
    data: Path,
    limit: int | None,
    threads: int,
    jobs: int,
    device: str,
    say: Callable[[str], None],
) -> Path:
    """Run a part, or go on with it; return its folder.

    Raises:
        UserError: As `regbench.runner.run.run`.
    """
    config = RunConfig(
        method=list(dict.fromkeys(method for methods in part.methods.values() for method in methods)),
        protocol=list(part.protocols.values()),
        limit=limit,
        threads=threads,
        jobs=jobs,
        device=device,
        data=str(data),
        out=str(out / part.name),
    )
    return run(config, command=["reproduction", part.name], progress=_Lines(say)).path


def write_table(name: str, words: str, parts: Sequence[Part], folders: Sequence[Path], out: Path) -> list[Row]:
    """Write NAME.md and NAME.csv, ours beside the paper's, and NAME-full.md and .json, ours alone; return the rows.

    Args:
        name: Of the files.
        words: What stands over the table.
        parts: What was run.
        folders: Where, in the same order.
        out: Where to write.
    """
    full = render(folders, format="markdown")
    write_atomically(out / f"{name}-full.md", full.encode() + b"\n")
    text = render(folders, format="json")
    write_atomically(out / f"{name}-full.json", text.encode() + b"\n")
    ours = {(row["method"], row["protocol"]): row for row in json.loads(text)}
    rows = [
        row
        for part in parts
        for group, protocol in part.protocols.items()
        for row in _beside(part, group, protocol, ours)
    ]
    _write_csv(out / f"{name}.csv", rows)
    lines = [words, ""]
    for protocol in dict.fromkeys(row["protocol"] for row in rows):
        section = [row for row in rows if row["protocol"] == protocol]
        lines += [f"**{protocol}**", "", *_markdown(section), ""]
        lines += [f"{row['method']}: {row['note']}  " for row in section if row["note"]]
        lines.append("")
    write_atomically(out / f"{name}.md", "\n".join(lines).encode())
    return rows


def _beside(part: Part, group: str, protocol: str, ours: Mapping[tuple[str, str], Row]) -> list[Row]:
    """Return rows in the paper's order: one of its own, then those of ours that stand for it; the rest last."""
    rows: list[Row] = []
    published = {row["method"].removesuffix(" (paper)"): row for row in published_rows(group, protocol)}
    if unknown := set(part.methods) - {""} - set(published):
        raise UserError(f"the paper has no row '{min(unknown)}' in {group}")
    for printed_as, row in published.items():
        rows.append(
            {"protocol": protocol, "paper's row": printed_as, "method": f"{printed_as} (paper)", "n": row["n"]}
            | {"failures": None, "recall_5deg": None, "note": row["note"]}
            | {key: row["printed"][key] for key in CELLS}
            | {"impossible": row["impossible"]}
        )
        rows += [_our_row(printed_as, method, protocol, ours) for method in part.methods.get(printed_as, ())]
    return rows + [_our_row("", method, protocol, ours) for method in part.methods.get("", ())]


def _our_row(printed_as: str, method: str, protocol: str, ours: Mapping[tuple[str, str], Row]) -> Row:
    row = ours[method, protocol]
    return (
        {"protocol": protocol, "paper's row": printed_as, "method": method, "n": row["n"]}
        | {"failures": sum(row["failures"].values()), "recall_5deg": row["recall_5deg"], "note": None}
        | {key: row[key] for key in CELLS}
        | {"impossible": []}
    )


def _markdown(rows: Sequence[Row]) -> list[str]:
    lines = [f"| row | n | {' | '.join(CELLS.values())} | recall 5° | failures |", "| --- |" + " ---: |" * 7]
    for row in rows:
        cells = [_cell(row[key], DIGITS.get(key, 4)) + ("!" if key in row["impossible"] else "") for key in CELLS]
        name = row["method"].replace("[", "\\[").replace("]", "\\]").replace("|", "\\|")
        name = f"**{name}**" if row["failures"] is None else name
        ends = [_cell(row["recall_5deg"]), "not stated" if row["failures"] is None else str(row["failures"])]
        lines.append(f"| {' | '.join([name, str(row['n']), *cells, *ends])} |")
    return lines


def _cell(value: Any, digits: int = 4) -> str:
    """Return a cell: what is printed as it is, ours with so many digits after the point."""
    if value is None:
        return "-"
    return value if isinstance(value, str) else f"{value:.{digits}f}"


def _write_csv(path: Path, rows: Sequence[Row]) -> None:
    text = io.StringIO()
    heads = [head for head in rows[0] if head not in ("impossible", "note")]
    writer = csv.DictWriter(text, [*heads, "cannot_hold"], extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    writer.writerows(row | {"cannot_hold": " ".join(row["impossible"])} for row in rows)
    write_atomically(path, text.getvalue().encode())


def write_times(name: str, words: str, part: Part, protocol: str, folder: Path, out: Path) -> None:
    """Write NAME.md: the times that the paper's text gives, and ours of one protocol, with the machines."""
    ours = {row["method"]: row for row in json.loads(render([folder], format="json", protocols=[protocol]))}
    lines = [words, "", "| row | ms a pair | what |", "| --- | ---: | --- |"]
    for row in published_times():
        lines.append(f"| **{row['method']} (paper)** | {row['ms_per_pair']} | mean, {row['device']} |")
        for method in part.methods.get(row["method"], ()):
            time_ms, p95_ms = ours[method]["time_median_ms"], ours[method]["time_p95_ms"]
            cells = (
                ["-", "none answered"] if time_ms is None else [f"{time_ms:.3f}", f"median, 95 % under {p95_ms:.3f}"]
            )
            name_cell = method.replace("[", "\\[").replace("]", "\\]")
            lines.append(f"| {name_cell} | {cells[0]} | {cells[1]} |")
    write_atomically(out / f"{name}.md", "\n".join([*lines, ""]).encode())
