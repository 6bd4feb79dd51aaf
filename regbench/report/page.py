"""One self-contained page of a run or several: tables, charts, pairs to turn, failures, and what was run on what."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

from regbench.errors import UserError
from regbench.metrics.recall import THRESHOLDS
from regbench.metrics.table import METRICS
from regbench.report.categories import THRESHOLD, by_category
from regbench.report.failure_texts import failure_texts, failures_of
from regbench.report.layout import RANKING, SCORING, Notes, lay_out
from regbench.report.merge import read_runs
from regbench.report.page_charts import charts
from regbench.report.page_views import views
from regbench.report.problem_names import ProblemName, problem_names
from regbench.report.rundata import Group, RunData
from regbench.report.summary import sections, summarise
from regbench.report.table import add_published, choose, remarks_on
from regbench.runner.rundir import read_json
from regbench.runner.status import Status

# What of a manifest stands in the page's own table; the whole of it can be unfolded.
MANIFEST_LINES = ("command", "started", "finished", "regbench_version", "git", "seed", "data_dir")


def report_page(
    runs: Sequence[Path],
    *,
    paper: bool = False,
    protocols: Sequence[str] | None = None,
    methods: Sequence[str] | None = None,
    mixed: bool = False,
    data_dir: Path | None = None,
) -> tuple[str, list[str]]:
    """Return the page of run folders as HTML, and what is left out of it and why, in words.

    Nothing in it is fetched from elsewhere, and its policy forbids it. All that comes from outside (names, error
    texts, paths) is escaped: text by the template, data by `json_for_page`.

    Args:
        runs: Run folders; where two hold the same trial, the later one's counts.
        paper: Put the paper's rows beside ours, under the protocols that stand for its column groups.
        protocols: Only these ids; None for all.
        methods: Only these, as they were asked for; None for all.
        mixed: Print side by side what does not compare (see merge.py).
        data_dir: Prepared data, for the clouds; None for the usual place. Without it the page has no pairs, and says
            why.

    Raises:
        UserError: An unknown protocol or method, or a run that cannot be read.
    """
    run = choose(read_runs(runs, mixed=mixed), protocols, methods)
    groups: dict[str, list[Group]] = {}
    for group in run.groups:
        groups.setdefault(group.protocol.label, []).append(group)
    by_protocol = sections(summarise(run))
    if paper:
        add_published(by_protocol, {label: members[0].protocol for label, members in groups.items()})
    names, texts = problem_names(runs), failure_texts(runs)
    shown, left_out = [], []
    for label, members in groups.items():
        seen, why_not = _views(members, run, names, data_dir)
        left_out += [f"{label}: no pairs to look at: {why_not}"] if why_not else []
        shown.append(_section(members, run, by_protocol[label], names, texts) | {"views": seen, "why_not": why_not})
    style, script = (files("regbench.report").joinpath("page", name).read_text() for name in ("page.css", "page.js"))
    data = {
        "methods": list(dict.fromkeys(group.method.method for group in run.groups)),
        "protocols": [{key: section[key] for key in ("label", "charts", "views")} for section in shown],
    }
    page = _template().render(
        title=", ".join(groups),
        sections=shown,
        remarks=[RANKING, SCORING, *remarks_on(run, "html")],
        threshold="{:g}° and {:g}".format(*THRESHOLDS[THRESHOLD]),
        manifests=[_manifest(path) for path in runs],
        style=style,
        style_hash=_policy_hash(style),
        script=script,
        script_hash=_policy_hash(script),
        data=json_for_page(data),
    )
    return page, left_out


def _section(
    groups: Sequence[Group],
    run: RunData,
    rows: Sequence[dict[str, Any]],
    names: Mapping[tuple[str, int], ProblemName],
    texts: dict[str, str],
) -> dict[str, Any]:
    """Return what the template shows of one protocol."""
    metrics = [metric for metric in METRICS.values() if any(row.get(metric.key) is not None for row in rows)]
    notes = Notes()
    protocol = groups[0].protocol
    return {
        "label": protocol.label,
        "description": protocol.description,
        "n": protocol.n,
        "table": lay_out(protocol, rows, metrics, notes, rank_times=len(run.machines) == 1),
        "notes": {mark: text for text, mark in notes.marks.items()},
        "charts": charts(groups, run),
        "statuses": [status.value for status in Status if status is not Status.OK],
        "failures": failures_of(groups, texts),
        "categories": by_category(groups, run, names, METRICS[f"recall_{THRESHOLD}"]),
    }


def _views(
    groups: Sequence[Group], run: RunData, names: Mapping[tuple[str, int], ProblemName], data_dir: Path | None
) -> tuple[dict[str, Any] | None, str | None]:
    """Return the pairs of one protocol, or why there are none: a page is worth having without them."""
    try:
        found = views(groups, run, names, data_dir)
    except UserError as error:
        return None, str(error)
    return (found, None) if found["pairs"] else (None, "no trial of known ground truth was answered")


def _manifest(run_dir: Path) -> dict[str, Any]:
    """Return what the template shows of a run's manifest: a few lines, methods, protocols, and the whole of it."""
    content = read_json(run_dir / "manifest.json")
    return {
        "run": str(run_dir),
        "lines": {key: _words(content[key]) for key in MANIFEST_LINES if content.get(key) is not None},
        "hardware": {key: _words(value) for key, value in content["hardware"].items()},
        "versions": content.get("versions", {}),
        "config": {key: _words(value) for key, value in content["config"].items() if value not in (None, [])},
        "methods": content["methods"],
        "protocols": content["protocols"],
        "whole": json.dumps(content, indent=1, ensure_ascii=False),
    }


def _words(value: object) -> str:
    match value:
        case dict():
            return ", ".join(f"{key} {_words(inner)}" for key, inner in value.items())
        case list():
            return " ".join(map(_words, value))
        case bool():
            return "yes" if value else "no"
    return str(value)


def json_for_page(value: object) -> str:
    """Return JSON that can stand inside a script element: nothing in it can close the element or open a comment."""
    text = json.dumps(value, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _policy_hash(content: str) -> str:
    """Return what a Content-Security-Policy calls an inline style or script: all others are refused."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(content.encode()).digest()).decode()}'"


def _template() -> Any:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    loader = PackageLoader("regbench.report", "page")
    return Environment(
        loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    ).get_template("template.html")
