"""Tables as aligned plain text, at most 120 characters wide with the default columns."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

from regbench.report.layout import RANKING, SCORING, TESTING, WORSE_SIGN, Cell, Notes, Section, failures_in_words

WIDTH = 120
FAILURES_WIDTH = 26
GAP = "  "
RANK_SIGNS = {0: "", 1: "*", 2: "+"}


def text_table(sections: Sequence[tuple[Section, Notes]], remarks: Sequence[str]) -> str:
    """Return all sections, each with its footnotes, then what holds for the whole table."""
    parts = [_section(section, notes) for section, notes in sections]
    tested = [f"{WORSE_SIGN} {TESTING}"] if any(section.has_marks for section, _ in sections) else []
    more = dict.fromkeys(remark for section, _ in sections for remark in section.remarks)
    legend = [f"* best, + second best. {RANKING}", *tested, *more, SCORING, *remarks]
    return "\n\n".join([*parts, "\n".join(line for text in legend for line in textwrap.wrap(text, WIDTH))])


def _section(section: Section, notes: Notes) -> str:
    columns = [_column([line.cells[i] for line in section.lines]) for i in range(len(section.metrics))]
    counts = [line.n + line.n_mark for line in section.lines]
    names = [metric.name for metric in section.metrics]
    units = [metric.unit for metric in section.metrics]
    widths = [max(map(len, (name, unit, *column))) for name, unit, column in zip(names, units, columns, strict=True)]
    n_width = max(map(len, ("n", *counts)))
    failures = [_wrapped(failures_in_words(line.failures)) for line in section.lines]
    failures_width = max(len(part) for parts in (*failures, ["failures"]) for part in parts)
    methods = [line.method + line.mark for line in section.lines]
    room = WIDTH - sum(widths) - n_width - failures_width - len(GAP) * (len(widths) + 2)
    name_width = max(len("method"), *(len(name) for name in methods if len(name) <= room), 0)

    def put(method: str, n: str, cells: Sequence[str], failed: str) -> str:
        figures = [cell.rjust(width) for cell, width in zip(cells, widths, strict=True)]
        return GAP.join([method.ljust(name_width), n.rjust(n_width), *figures, failed]).rstrip()

    body: list[list[str]] = []
    for i in range(len(section.lines)):
        long = len(methods[i]) > name_width  # a long name takes a line of its own, nothing is cut
        first = put("" if long else methods[i], counts[i], [column[i] for column in columns], failures[i][0])
        more = [put("", "", [""] * len(widths), part) for part in failures[i][1:]]
        body.append([*([methods[i]] if long else []), first, *more])
    table = [put("method", "n", names, "failures"), put("", "", units, "")]
    rule = "-" * min(WIDTH, max(len(text) for texts in (table, *body) for text in texts))
    for before, line, texts in zip([None, *section.lines], section.lines, body, strict=False):
        if before is None or before.block != line.block:
            table.append(rule)
        table += texts
    title = textwrap.wrap(
        f"{section.protocol.label} ({section.protocol.n} problems): {section.protocol.description}", WIDTH
    )
    footnotes = [
        part
        for note, mark in notes.marks.items()
        for part in textwrap.wrap(f"{mark} {note}", WIDTH, subsequent_indent="  ")
    ]
    return "\n".join([*title, *table, *footnotes])


def _column(cells: Sequence[Cell]) -> list[str]:
    """Return a column's cells with what follows the figures padded, so that the figures stay aligned."""
    after = [RANK_SIGNS[cell.rank] + WORSE_SIGN * cell.worse + cell.mark for cell in cells]
    width = max(map(len, after), default=0)
    interval_width = max((len(cell.interval) for cell in cells), default=0)
    brackets = [f" {cell.interval.rjust(interval_width)}" if interval_width else "" for cell in cells]
    return [
        cell.text + suffix.ljust(width) + bracket for cell, suffix, bracket in zip(cells, after, brackets, strict=True)
    ]


def _wrapped(failures: str) -> list[str]:
    """Return failures in words on lines that break between two kinds alone."""
    unbroken = failures.replace(" ", "\N{NO-BREAK SPACE}").replace(",\N{NO-BREAK SPACE}", ", ")
    return [part.replace("\N{NO-BREAK SPACE}", " ") for part in textwrap.wrap(unbroken, FAILURES_WIDTH)]
