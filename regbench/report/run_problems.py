"""The clouds that a run was about, from its protocol and the prepared data."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from regbench.errors import UserError
from regbench.protocols.protocol import Pair, ProblemSet
from regbench.report.manifest import ProtocolInfo


def open_problems(protocol: ProtocolInfo, data_dir: Path | None) -> ProblemSet:
    """Return the problems of a run's protocol.

    Args:
        protocol: The protocol, as the run's manifest names it.
        data_dir: Prepared data, or None for the usual place.

    Raises:
        UserError: The data is not there or not the data of the run.
    """
    from regbench.datasets.store import data_dir as usual_data_dir
    from regbench.registry import find_protocol

    folder = usual_data_dir(data_dir)
    problems = find_protocol(protocol.id).open(folder)
    if protocol.data_sha256 is not None and problems.data_sha256 != protocol.data_sha256:
        raise UserError(
            f"protocol {protocol.id}: the data in {folder} is not the data of the run; give the run's with --data"
        )
    return problems


def answered_pair(problems: ProblemSet, protocol: ProtocolInfo, problem: int, truth: object) -> Pair:
    """Return the pair of one problem of known truth.

    Raises:
        UserError: It is not the one that the run answered.
    """
    pair = problems.pair(problem) if problem < len(problems) else None
    if pair is None or pair.T_target_source is None or not np.array_equal(pair.T_target_source, np.asarray(truth)):
        raise UserError(
            f"protocol {protocol.id}: problem {problem} is not the one that the run answered; the protocol has "
            "changed since. Give the run's command again, or leave out what needs the clouds"
        )
    return pair
