"""The table of figures: what each is drawn by, and which metrics it takes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from regbench.errors import UserError
from regbench.metrics.table import Metric, find_metrics
from regbench.report.figures.ecdf import ecdf_panels
from regbench.report.figures.heatmap import BY, heatmap_panels
from regbench.report.figures.look import looks
from regbench.report.figures.panel import Material, Panel
from regbench.report.figures.pareto import FRONT, FRONT_WORDS, pareto_panels
from regbench.report.figures.recall import WITHIN, recall_panels
from regbench.report.figures.times import time_panels
from regbench.report.figures.words import method_words
from regbench.suggest import unknown

Legend = Sequence[tuple[str, dict[str, Any]]]


@dataclass(frozen=True)
class Kind:
    """A figure.

    Attributes:
        panels: Makes its panels.
        legend: Makes its legend; empty where the methods' names stand beside what is drawn.
        metrics: Keys of its metrics, unless others are asked for.
        takes: Whether it can be drawn of a metric.
        taken: Which those are, in words.
        choices: What its own option chooses from.
        chosen: What is taken unless asked for.
        option: The option's name.
        abreast: How many panels stand beside each other on the width of a page.
        compares_times: Whether runs of different machines do not belong into one.
    """

    panels: Callable[[Material], list[Panel]]
    legend: Callable[[Material], Legend]
    metrics: tuple[str, ...]
    takes: Callable[[Metric], bool]
    taken: str
    choices: tuple[str, ...] = ()
    chosen: tuple[str, ...] = ()
    option: str = ""
    abreast: int = 2
    compares_times: bool = False

    def find_metrics(self, name: str, asked: Sequence[str] | None) -> list[Metric]:
        """Return the metrics asked for, or its own.

        Raises:
            UserError: A metric is unknown, or the figure cannot be drawn of it.
        """
        found = find_metrics(self.metrics if asked is None else asked)
        for metric in found:
            if not self.takes(metric):
                raise UserError(f"plot {name}: --metric {metric.key}: it is drawn of {self.taken}")
        return found

    def find_choice(self, asked: Sequence[str] | None) -> Sequence[str]:
        """Return what was asked for of its choices, or its own.

        Raises:
            UserError: There is no such choice.
        """
        for word in asked or ():
            if word not in self.choices:
                raise UserError(unknown(f"--{self.option}", word, self.choices))
        return self.chosen if asked is None else asked


def _lines(material: Material) -> Legend:
    return [(method_words(name, material.rows), look.line()) for name, look in looks(material.methods).items()]


def _points(material: Material) -> Legend:
    points = [
        (method_words(name, material.rows), {"linestyle": "none", **look.point(filled=False)})
        for name, look in looks(material.methods).items()
    ]
    return [*points, (FRONT_WORDS, FRONT)]


def _no_legend(material: Material) -> Legend:
    return []


KINDS: Mapping[str, Kind] = {
    "recall": Kind(
        recall_panels,
        _lines,
        (),
        lambda metric: False,
        "errors, not of a metric; see --within",
        choices=tuple(WITHIN),
        chosen=("both",),
        option="within",
    ),
    "pareto": Kind(
        pareto_panels,
        _points,
        ("recall_5deg",),
        lambda metric: metric.needs != "times",
        "metrics of accuracy, against the median time",
        compares_times=True,
    ),
    "ecdf": Kind(
        ecdf_panels,
        _lines,
        ("rre_median_deg", "rte_median"),
        lambda metric: not metric.higher_is_better,
        "errors or times of single trials, not of a recall",
    ),
    "time": Kind(
        time_panels,
        _no_legend,
        ("time_median_ms",),
        lambda metric: metric.needs == "times",
        "times",
        compares_times=True,
    ),
    "heatmap": Kind(
        heatmap_panels,
        _no_legend,
        ("recall_5deg",),
        lambda metric: True,
        "any metric",
        choices=BY,
        option="by",
        abreast=1,
    ),
}
