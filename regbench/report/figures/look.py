"""How a figure looks on a printed page: its sizes, its font, and a line for each method that is its own in grey too."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from regbench.errors import UserError

# One column and both columns of a two-column page, in inches.
WIDTHS = {"column": 3.3, "page": 7.0}
# Sizes of text in points: titles and axes; ticks and legend; figures in cells.
LARGE, MEDIUM, SMALL = 8, 7, 6
# The advance of the widest digits and of nearly all letters of the font, as a share of its size.
ADVANCE = 0.64
INCH = 72.0

# Okabe and Ito's palette, without what is too light for a line; neighbours differ in luminance by a fifth.
COLOURS = ("#000000", "#E69F00", "#0072B2", "#56B4E9", "#D55E00")
DASHES: tuple[Any, ...] = (
    "-",
    (0, (4, 1.5)),
    (0, (1, 1)),
    (0, (5, 1.2, 1, 1.2)),
    (0, (5, 1.2, 1, 1.2, 1, 1.2)),
)
# All can be filled or hollow.
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "p", "<", "h", ">", "*")
# More cannot be told apart; colours, dashes and markers together would repeat after 60.
MOST_METHODS = 24

STYLE: dict[str, Any] = {
    "font.family": "DejaVu Sans",  # comes with matplotlib, so that every machine has it
    "font.size": LARGE,
    "axes.labelsize": LARGE,
    "axes.titlesize": LARGE,
    "xtick.labelsize": MEDIUM,
    "ytick.labelsize": MEDIUM,
    "legend.fontsize": MEDIUM,
    "axes.linewidth": 0.6,
    "lines.linewidth": 1.1,
    "lines.markersize": 4,
    "axes.grid": True,
    "grid.linewidth": 0.4,
    "grid.alpha": 0.4,
    "axes.axisbelow": True,
    "text.usetex": False,
    "text.parse_math": False,  # a method's name is no formula
    "pdf.fonttype": 42,  # TrueType: printers refuse Type 3
    "svg.hashsalt": "regbench",  # else its ids are drawn anew each time
    "savefig.dpi": 300,
}


@dataclass(frozen=True)
class Look:
    """The line of a method."""

    colour: str
    dash: Any
    marker: str

    def line(self) -> dict[str, Any]:
        """Return what matplotlib's plot() takes for a line with markers."""
        return {"color": self.colour, "linestyle": self.dash, **self.point(filled=False)}

    def point(self, *, filled: bool) -> dict[str, Any]:
        """Return what it takes for the markers."""
        fill = self.colour if filled else "white"
        return {"marker": self.marker, "markerfacecolor": fill, "markeredgecolor": self.colour, "markeredgewidth": 0.8}


@contextmanager
def printed_page() -> Iterator[None]:
    """Draw and save in this style within, whatever matplotlib was set to; afterwards all is as it was."""
    from matplotlib.style import context

    styles: list[str | dict[str, Any]] = ["default", STYLE]
    with context(styles):
        yield


def looks(methods: Iterable[str]) -> dict[str, Look]:
    """Return a look for each method, no two the same.

    Raises:
        UserError: There are too many to tell apart.
    """
    names = list(dict.fromkeys(methods))
    if len(names) > MOST_METHODS:
        raise UserError(
            f"{len(names)} methods in one figure cannot be told apart: choose up to {MOST_METHODS} with --method"
        )
    return {
        name: Look(COLOURS[i % len(COLOURS)], DASHES[i % len(DASHES)], MARKERS[i % len(MARKERS)])
        for i, name in enumerate(names)
    }


def inches(characters: int, points: float) -> float:
    """Return how long so many characters are at most, nearly always."""
    return characters * points * ADVANCE / INCH


def characters(length: float, points: float) -> int:
    """Return how many characters fit into a length in inches."""
    return max(1, int(length * INCH / points / ADVANCE))
