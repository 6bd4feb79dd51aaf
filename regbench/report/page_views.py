"""The pairs that a page shows in three dimensions: each method's worst, median and best on a protocol."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from regbench.report.extremes import pick
from regbench.report.packed_clouds import PackedPair, pack_pair
from regbench.report.page_charts import number
from regbench.report.problem_names import ProblemName
from regbench.report.run_problems import answered_pair, open_problems
from regbench.report.rundata import Group, RunData
from regbench.report.trial_errors import trial_errors

WORST, MEDIAN, BEST = 3, 1, 1
MAX_POINTS = 800


def views(
    groups: Sequence[Group], run: RunData, names: Mapping[tuple[str, int], ProblemName], data_dir: Path | None
) -> dict[str, Any]:
    """Return pairs and clouds of one protocol, ready for JSON; a cloud that several methods show is in it once.

    Raises:
        UserError: The data is not there, or not the data of the run.
    """
    protocol = groups[0].protocol
    truths = run.truths[protocol.id, protocol.sha256]
    problems = open_problems(protocol, data_dir)
    pairs: list[dict[str, Any]] = []
    clouds: dict[int, PackedPair] = {}
    for group in groups:
        errors = trial_errors(group, run)
        for picked in pick(errors, worst=WORST, median=MEDIAN, best=BEST):
            problem = int(errors.problems[picked.trial])
            if problem not in clouds:
                pair = answered_pair(problems, protocol, problem, truths[problem])
                clouds[problem] = pack_pair(pair.source, pair.target, MAX_POINTS)
            name = names.get((protocol.id, problem), ProblemName())
            pairs.append(
                {
                    "method": group.method.method,
                    "kind": picked.kind,
                    "rank": picked.rank,
                    "problem": problem,
                    "label": name.label,
                    "id": name.id,
                    "rotation_deg": number(errors.rotation_errors_deg[picked.trial]),
                    "translation": number(errors.translation_errors[picked.trial]),
                    "T_target_source": errors.T_target_source[picked.trial, :3].round(7).ravel().tolist(),
                }
            )
    return {"pairs": pairs, "clouds": clouds}
