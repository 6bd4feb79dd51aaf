r"""Tables as LaTeX (booktabs), laid out as the paper's Table 1: one column group per protocol.

The document needs \usepackage{booktabs} and \usepackage{graphicx}; nothing else.
"""

from __future__ import annotations

from collections.abc import Sequence

from regbench.report.layout import (
    BLOCKS,
    RANKING,
    SCORING,
    TESTING,
    WORSE_SIGN,
    Cell,
    Line,
    Notes,
    Section,
    failures_in_words,
)

# "[" would be read as the argument of a row's \\, so it is put in braces like every other special.
SPECIAL = {
    "\\": r"\textbackslash{}",
    "{": r"\{",
    "}": r"\}",
    "_": r"\_",
    "%": r"\%",
    "&": r"\&",
    "#": r"\#",
    "$": r"\$",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    "[": "{[}",
    "]": "{]}",
    "°": r"$^{\circ}$",
    "²": "$^{2}$",
}
MARKS = {"⁻": "-", "†": r"\dagger", "‡": r"\ddagger", "§": r"\mathsection", "¶": r"\mathparagraph"}


def latex_table(sections: Sequence[Section], notes: Notes, remarks: Sequence[str]) -> str:
    """Return one table* with every section as a column group and the failures as its last column."""
    groups = [len(section.metrics) + 1 for section in sections]
    lines = [
        r"% needs \usepackage{booktabs} and \usepackage{graphicx}",
        r"\begin{table*}[t]",
        r"\centering",
        r"\resizebox{\linewidth}{!}{%",
        rf"\begin{{tabular}}{{l{''.join('r' * width for width in groups)}}}",
        r"\toprule",
        *_head(sections, groups),
    ]
    body = _body(sections, notes)
    for block in body:
        lines += [r"\midrule", *block]
    footnotes = [f"{_mark(mark)} {escape(note)}." for note, mark in notes.marks.items()]
    tested = [f"{_mark(WORSE_SIGN)} {escape(TESTING)}"] if any(section.has_marks for section in sections) else []
    more = dict.fromkeys(escape(remark) for section in sections for remark in section.remarks)
    words = " ".join([escape(RANKING), *tested, *more, escape(SCORING)])
    legend = rf"\textbf{{Best}}, \underline{{second best}}. {words}"
    lines += [
        r"\bottomrule",
        r"\end{tabular}}",
        r"\par\smallskip\footnotesize",
        " ".join([*footnotes, legend, *map(escape, remarks)]),
        rf"\caption{{Registration errors on {escape(', '.join(s.protocol.label for s in sections))}.}}",
        r"\label{tab:regbench}",
        r"\end{table*}",
    ]
    return "\n".join(lines)


def escape(text: str) -> str:
    """Return text that LaTeX sets as it is."""
    return "".join(SPECIAL.get(character, character) for character in text)


def _head(sections: Sequence[Section], groups: Sequence[int]) -> list[str]:
    titles = [
        rf"\multicolumn{{{width}}}{{c}}{{{escape(section.protocol.label)} ($n = {section.protocol.n}$)}}"
        for section, width in zip(sections, groups, strict=True)
    ]
    rules, first = [], 2
    for width in groups:
        rules.append(rf"\cmidrule(lr){{{first}-{first + width - 1}}}")
        first += width
    names = [escape(name) for section in sections for name in (*(m.name for m in section.metrics), "failures")]
    return [_row(["", *titles]), "".join(rules), _row(["Method", *names])]


def _body(sections: Sequence[Section], notes: Notes) -> list[list[str]]:
    """Return the rows by block; a method that a protocol lacks has dashes there."""
    blocks = []
    for block in BLOCKS:
        by_section = [{line.method: line for line in section.lines if line.block == block} for section in sections]
        methods = dict.fromkeys(method for lines in by_section for method in lines)
        rows = []
        for method in methods:
            marks = dict.fromkeys(lines[method].mark for lines in by_section if method in lines)
            cells = [escape(method) + _mark("".join(marks))]
            for section, lines in zip(sections, by_section, strict=True):
                cells += _cells(section, lines.get(method), notes)
            rows.append(_row(cells))
        if rows:
            blocks.append(rows)
    return blocks


def _cells(section: Section, line: Line | None, notes: Notes) -> list[str]:
    if line is None:
        return ["--"] * (len(section.metrics) + 1)
    return [*map(_cell, line.cells), _failures(section, line, notes)]


def _failures(section: Section, line: Line, notes: Notes) -> str:
    """Return the number of failures, its footnotes how many of each kind and of how many trials."""
    mark = line.n_mark
    if line.n.isdigit() and int(line.n) != section.protocol.n:
        mark += notes.mark(f"of {line.n} trials")
    if line.failures:
        words = failures_in_words(line.failures)
        mark += notes.mark(f"{line.method} on {section.protocol.label}: {words} of {line.n}")
    number = "--" if line.failures is None else str(sum(line.failures.values()))
    return number + _mark(mark)


def _cell(cell: Cell) -> str:
    text = "--" if cell.text == "-" else cell.text
    figure = {0: text, 1: rf"\textbf{{{text}}}", 2: rf"\underline{{{text}}}"}[cell.rank]
    marked = figure + _mark(WORSE_SIGN * cell.worse + cell.mark)
    return rf"{marked} {{\scriptsize {escape(cell.interval)}}}" if cell.interval else marked


def _mark(mark: str) -> str:
    if not mark:
        return ""
    return f"$^{{{''.join(MARKS.get(character, character) for character in mark)}}}$"


def _row(cells: Sequence[str]) -> str:
    return " & ".join(cells) + r" \\"
