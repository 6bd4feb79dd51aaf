"""Measures LatentCEM in this process on some problems of a protocol, and keeps what was measured in a folder."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from regbench.contract import Problem
from regbench.errors import UserError
from regbench.files import write_atomically
from regbench.metrics.rotation import euler_residuals_deg, mae, rmse, rotation_error_deg
from regbench.metrics.translation import translation_residuals
from regbench.parameters import parameters_of
from regbench.registry import find_protocol

from .registrar import LatentCem

Figures = dict[str, float]


@dataclass(frozen=True, eq=False)
class Problems:
    """The first problems of a protocol, with their answers.

    Attributes:
        name: Protocol, number of problems, identity of the data: what a measurement depends on.
        pairs: What a method may see, and the (4, 4) truth.
    """

    name: str
    pairs: Sequence[tuple[Problem, NDArray[np.float64]]]

    @classmethod
    def of(cls, protocol: str, data: Path, limit: int, device: str) -> Problems:
        """Open them.

        Raises:
            UserError: The protocol's data is not prepared in `data`.
        """
        opened = find_protocol(protocol).open(data)
        pairs = []
        for index in range(min(limit, len(opened))):
            problem, pair = opened.problem(index, protocol=protocol, device=device)
            assert pair.T_target_source is not None
            pairs.append((problem, pair.T_target_source))
        return cls(f"{protocol} {len(pairs)} {opened.data_sha256}", pairs)


def measure(method: LatentCem, problems: Problems) -> Figures:
    """Return errors over all pairs and median times; a pair that fails counts as if the identity were answered.

    Times are of one call after a first one that is not counted, in this process: "plan_ms" the planner's, "time_ms"
    the whole call's.

    Raises:
        UserError: The method's weights are missing or damaged.
    """
    method.prepare()
    with suppress(ValueError):  # rewards that are not finite: what weights of a failed training give
        method.warm_up(problems.pairs[0][0])
    answers, failures, plan_s, time_s = [], 0, [], []
    for problem, _ in problems.pairs:
        began = time.perf_counter()
        try:
            answer = method.register(problem)
        except ValueError:  # likewise
            answers.append(np.eye(4))
            failures += 1
            continue
        time_s.append(time.perf_counter() - began)
        plan_s.append(answer.stages_s["plan"])
        answers.append(answer.T_target_source)
    estimates, truths = np.stack(answers), np.stack([truth for _, truth in problems.pairs])
    rotations = estimates[:, :3, :3], truths[:, :3, :3]
    residuals_deg, residuals = euler_residuals_deg(*rotations), translation_residuals(estimates, truths)
    return {
        "n": len(answers),
        "failures": failures,
        "rmse_r_deg": rmse(residuals_deg),
        "mae_r_deg": mae(residuals_deg),
        "rmse_t": rmse(residuals),
        "mae_t": mae(residuals),
        "rre_median_deg": float(np.median(rotation_error_deg(*rotations))),
        "plan_ms": 1e3 * float(np.median(plan_s)) if plan_s else float("nan"),
        "time_ms": 1e3 * float(np.median(time_s)) if time_s else float("nan"),
    }


class Kept:
    """Measurements in a folder, one file each: one of the same name and the same circumstances is not made again.

    Args:
        folder: Where they lie; made when the first is written.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def measured(
        self, name: str, method: LatentCem, problems: Problems, weights: Path, circumstances: Mapping[str, Any]
    ) -> tuple[Figures, bool]:
        """Return the figures of a method, and whether they were measured just now.

        Args:
            name: Of the measurement.
            method: What to measure.
            problems: On what.
            weights: The file that the method loads.
            circumstances: What else the figures depend on, as JSON can hold it.

        Raises:
            UserError: The weights are missing or damaged, or the folder cannot be written.
        """
        what = {
            "problems": problems.name,
            "source": _sha256_of_the_source(),
            "parameters": {key: value for key, value in parameters_of(method).items() if key != "weights"},
            "weights": _sha256(weights),
            **circumstances,
        }
        path = self.folder / f"{name}.json"
        kept = _read(path)
        if kept.get("what") == what:
            return kept["figures"], False
        figures = measure(method, problems)
        _make(self.folder)
        write_atomically(path, (json.dumps({"what": what, "figures": figures}, indent=1) + "\n").encode())
        return figures, True


def _read(path: Path) -> dict[str, Any]:
    """Return what is kept, or nothing where the file is not there or not ours."""
    try:
        found = json.loads(path.read_bytes())
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"{folder}: cannot be made ({error.strerror})") from error


def _sha256_of_the_source() -> str:
    """Return a hash of this package's modules: figures of another version of the method are not kept."""
    return hashlib.sha256(b"".join(_content(path) for path in sorted(Path(__file__).parent.glob("*.py")))).hexdigest()


def _sha256(path: Path) -> str:
    return hashlib.sha256(_content(path)).hexdigest()


def _content(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise UserError(f"latentcem: {path}: cannot be read ({error.strerror})") from error
