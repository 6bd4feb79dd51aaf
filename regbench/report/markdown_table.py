"""Tables as GitHub-flavoured Markdown."""

from __future__ import annotations

import re
from collections.abc import Sequence

from regbench.report.layout import RANKING, SCORING, TESTING, WORSE_SIGN, Cell, Notes, Section, failures_in_words


def markdown_table(sections: Sequence[tuple[Section, Notes]], remarks: Sequence[str]) -> str:
    """Return all sections, each with its footnotes, then what holds for the whole table."""
    parts = [_section(section, notes) for section, notes in sections]
    tested = [f"{WORSE_SIGN} {escape(TESTING)}"] if any(section.has_marks for section, _ in sections) else []
    more = dict.fromkeys(escape(remark) for section, _ in sections for remark in section.remarks)
    legend = f"**Best**, <ins>second best</ins>. {' '.join([RANKING, *tested, *more, SCORING, *map(escape, remarks)])}"
    return "\n\n".join([*parts, legend])


def escape(text: str) -> str:
    """Return text that Markdown shows as it is, inside a table cell too."""
    return re.sub(r"([\\`*_\[\]<>|&#~])", r"\\\1", text)


def _section(section: Section, notes: Notes) -> str:
    protocol = section.protocol
    heads = [f"{metric.name} ({metric.unit})" if metric.unit else metric.name for metric in section.metrics]
    head = _row(["method", "n", *heads, "failures"])
    rule = _row(["---", *["---:"] * (len(heads) + 1), "---"])
    rows: list[str] = []
    for block in section.blocks():
        if rows:  # Markdown has no rule within a table: an empty row sets the blocks apart
            rows.append(_row([""] * (len(heads) + 3)))
        rows += [
            _row(
                [
                    escape(line.method) + line.mark,
                    line.n + line.n_mark,
                    *map(_cell, line.cells),
                    failures_in_words(line.failures),
                ]
            )
            for line in block
        ]
    title = f"**{escape(protocol.label)}** ({protocol.n} problems): {escape(protocol.description)}"
    table = "\n".join([head, rule, *rows])
    footnotes = "  \n".join(f"{mark} {escape(note)}" for note, mark in notes.marks.items())
    return "\n\n".join(filter(None, [title, table, footnotes]))


def _row(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _cell(cell: Cell) -> str:
    figure = {0: cell.text, 1: f"**{cell.text}**", 2: f"<ins>{cell.text}</ins>"}[cell.rank]
    marked = figure + WORSE_SIGN * cell.worse + cell.mark
    return f"{marked} {escape(cell.interval)}" if cell.interval else marked
