"""A run's pairs to look at: a method's worst, median and best, each with its picture."""

from __future__ import annotations

import hashlib
import io
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from regbench.errors import UserError
from regbench.files import write_atomically
from regbench.report.distance_picture import distance_picture
from regbench.report.extremes import Kind, pick
from regbench.report.problem_names import ProblemName, problem_names
from regbench.report.run_problems import answered_pair, open_problems
from regbench.report.rundata import Group, RunData, read_run
from regbench.report.table import choose
from regbench.report.trial_errors import trial_errors

if TYPE_CHECKING:
    from PIL.Image import Image


@dataclass(frozen=True, eq=False)
class Shown:
    """A pair: whose, why, how far off in degrees and in the clouds' unit, and what draws its picture."""

    method: str
    protocol: str
    kind: Kind
    rank: int
    problem: int
    name: ProblemName
    rotation_error_deg: float
    translation_error: float
    draw: Callable[[], Image]

    @property
    def words(self) -> str:
        """All of it in one line."""
        named = ", ".join(filter(None, (self.name.label, self.name.id)))
        return (
            f"{self.method} on {self.protocol}, {self.kind} {self.rank}: problem {self.problem}"
            f"{f' ({named})' if named else ''}, off by {self.rotation_error_deg:.4g} deg and "
            f"{self.translation_error:.4g} of length"
        )

    @property
    def file_name(self) -> str:
        """A name for its PNG file: letters, digits, dots and dashes alone, whatever the method is called.

        A part of a hash keeps apart what is the same without its other signs.
        """
        what = re.sub(r"[^A-Za-z0-9.]+", "-", f"{self.protocol} {self.method}").strip("-.")[:120]
        hashed = hashlib.sha256(f"{self.protocol} {self.method}".encode()).hexdigest()[:6]
        return f"{what}-{hashed}-{self.kind}-{self.rank:03d}-problem-{self.problem}.png"


def shown_pairs(
    run_dir: Path,
    *,
    methods: Sequence[str] | None = None,
    protocols: Sequence[str] | None = None,
    worst: int = 0,
    median: int = 0,
    best: int = 0,
    data_dir: Path | None = None,
) -> Iterator[Shown]:
    """Yield the pairs of a run, drawn one after another: protocols, methods, then worst, median and best.

    Only trials that answered and whose truth is known are picked (see extremes.py).

    Raises:
        UserError: The run cannot be read, a name is not in it, its data is not there, or there is nothing to show.
    """
    run = choose(read_run(run_dir), protocols, methods)
    names = problem_names([run_dir])
    found = 0
    for group in run.groups:
        for shown in _of_group(group, run, names, (worst, median, best), data_dir):
            found += 1
            yield shown
    if not found:
        raise UserError(f"{run_dir}: no trial of what was asked for has an answer and a known truth; nothing to show")


def _of_group(
    group: Group,
    run: RunData,
    names: dict[tuple[str, int], ProblemName],
    counts: tuple[int, int, int],
    data_dir: Path | None,
) -> Iterator[Shown]:
    errors, protocol = trial_errors(group, run), group.protocol
    worst, median, best = counts
    picks = pick(errors, worst=worst, median=median, best=best)
    if not picks:
        return
    problems = open_problems(protocol, data_dir)
    for picked in picks:
        problem = int(errors.problems[picked.trial])
        pair = answered_pair(problems, protocol, problem, run.truths[protocol.id, protocol.sha256][problem])
        rotation, translation = errors.rotation_errors_deg[picked.trial], errors.translation_errors[picked.trial]
        yield Shown(
            method=group.method.method,
            protocol=protocol.id,
            kind=picked.kind,
            rank=picked.rank,
            problem=problem,
            name=names.get((protocol.id, problem), ProblemName()),
            rotation_error_deg=float(rotation),
            translation_error=float(translation),
            draw=partial(
                distance_picture,
                pair.source,
                pair.target,
                errors.T_target_source[picked.trial],
                f"{group.method.method}, problem {problem}: {rotation:.4g} deg, {translation:.4g} of length off",
            ),
        )


def save_png(shown: Shown, folder: Path) -> Path:
    """Save a pair's picture under its name; make the folder where it is missing.

    Raises:
        UserError: It cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"{folder}: cannot be made ({error.strerror})") from error
    content = io.BytesIO()
    shown.draw().save(content, format="PNG", optimize=True)
    path = folder / shown.file_name
    write_atomically(path, content.getvalue())
    return path
