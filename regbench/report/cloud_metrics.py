"""The metrics that need the clouds: computed on demand from the protocol, kept beside the run."""

from __future__ import annotations

import hashlib
import json
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np

from regbench.errors import UserError
from regbench.files import write_atomically
from regbench.protocols.protocol import ProblemSet
from regbench.report.manifest import ProtocolInfo
from regbench.report.run_problems import answered_pair, open_problems
from regbench.report.rundata import Group, RunData
from regbench.report.trials import Trial

CACHE = Path("tables", "cloud_metrics.jsonl")
KEYS = ("symmetry_aware_error", "modified_chamfer")
Errors = dict[str, float]


def cloud_errors(run: RunData, data_dir: Path | None) -> dict[str, dict[str, float]]:
    """Return every metric of KEYS for every trial whose ground truth is known, by metric, then by trial key.

    What a run's tables/cloud_metrics.jsonl holds is not computed again; a changed answer is.

    Args:
        run: The trials; a failed one counts as the identity.
        data_dir: Prepared data, or None for the usual place.

    Raises:
        UserError: The data is not there or not the data of the run, or the cache cannot be written.
    """
    errors: dict[str, dict[str, float]] = {key: {} for key in KEYS}
    by_protocol: dict[tuple[str, str], list[Group]] = defaultdict(list)
    for group in run.groups:
        by_protocol[group.protocol.id, group.protocol.sha256].append(group)
    for groups in by_protocol.values():
        for trial_key, found in _of_protocol(groups, run, data_dir):
            for key in KEYS:
                errors[key][trial_key] = found[key]
    return errors


def _of_protocol(groups: Sequence[Group], run: RunData, data_dir: Path | None) -> Iterator[tuple[str, Errors]]:
    protocol = groups[0].protocol
    truths = run.truths[protocol.id, protocol.sha256]
    folders = list(dict.fromkeys(folder for group in groups for folder in group.run_dirs))
    cache = {name: found for folder in folders for name, found in _read_cache(folder / CACHE).items()}
    trials: dict[int, dict[str, Trial]] = defaultdict(dict)  # by problem: its clouds and trees are made once
    for group in groups:
        for (problem, _), trial in group.trials.items():
            if truths[problem] is not None:
                trials[problem][_name(trial, protocol)] = trial
    missing = {problem: [name for name in named if name not in cache] for problem, named in trials.items()}
    if any(missing.values()):
        problems = open_problems(protocol, data_dir)
        for problem, names in missing.items():
            if names:
                answers = [trials[problem][name].T_target_source for name in names]
                cache.update(zip(names, _score(problems, protocol, problem, truths[problem], answers), strict=True))
        _write_cache(folders[-1] / CACHE, cache)
    for named in trials.values():
        for name, trial in named.items():
            yield trial.key, cache[name]


def _score(
    problems: ProblemSet, protocol: ProtocolInfo, problem: int, truth: object, answers: Sequence[list[list[float]]]
) -> list[Errors]:
    from regbench.metrics.cloud import modified_chamfer, symmetry_aware_error  # loads scipy.spatial, 0.4 s

    pair = answered_pair(problems, protocol, problem, truth)
    estimates = np.array(answers, dtype=np.float64)
    symmetric = symmetry_aware_error(estimates, np.asarray(truth, dtype=np.float64), pair.source)
    chamfer = modified_chamfer(estimates, pair.source, pair.target, pair.clean_source, pair.clean_target)
    return [dict(zip(KEYS, map(float, both), strict=True)) for both in zip(symmetric, chamfer, strict=True)]


def _name(trial: Trial, protocol: ProtocolInfo) -> str:
    """Return what the cache calls a trial: its key, and a hash of the answer that was scored."""
    answer = hashlib.sha256(protocol.sha256.encode() + np.array(trial.T_target_source).tobytes()).hexdigest()
    return f"{trial.key}:{answer[:16]}"


def _read_cache(path: Path) -> dict[str, Errors]:
    """Return what is known already. A damaged line is no loss: what it held is computed again."""
    if not path.is_file():
        return {}
    cache = {}
    for line in path.read_text(errors="replace").splitlines():
        try:
            row = json.loads(line)
            cache[row["trial"]] = {key: float(row[key]) for key in KEYS}
        except (ValueError, KeyError, TypeError):
            continue
    return cache


def _write_cache(path: Path, cache: dict[str, Errors]) -> None:
    rows: Iterable[str] = (json.dumps({"trial": name, **found}) for name, found in cache.items())
    try:
        path.parent.mkdir(exist_ok=True)
    except OSError as error:
        raise UserError(f"{path.parent}: cannot be made ({error.strerror})") from error
    write_atomically(path, "".join(f"{row}\n" for row in rows).encode())
