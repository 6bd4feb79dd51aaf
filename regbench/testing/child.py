"""The process that a method is tested in: `python -m regbench.testing.child checks|answer`, request on stdin.

The parent survives whatever the method does. Results leave by a file descriptor of their own, one JSON line each,
because the method may print.
"""

from __future__ import annotations

import base64
import json
import os
import sys
from typing import Any

from regbench.testing import clouds
from regbench.testing.battery import BATTERY, run_check
from regbench.testing.check_result import CheckResult, Outcome
from regbench.testing.subject import Origin, Subject


def main(task: str) -> None:
    """Read a request from stdin and do the task: the remaining checks, or one answer."""
    asked: dict[str, Any] = json.load(sys.stdin)
    sys.path[:] = asked["path"]
    subject = Subject(Origin(**asked["origin"]).load(), asked["parameters"])
    if task == "answer":
        problem, truth = clouds.easy_problem()
        answer = subject.ask(subject.build(), problem, truth)
        # On a line of its own, the last one: the method may have printed before.
        sys.stdout.write("\n" + base64.b64encode(answer.tobytes()).decode() + "\n")
        return
    earlier = {name: CheckResult(name, Outcome(outcome), detail) for name, outcome, detail in asked["earlier"]}
    with os.fdopen(asked["results_fd"], "w") as results:
        for check in BATTERY:
            if check.name not in earlier:
                earlier[check.name] = result = run_check(check, subject, earlier)
                results.write(json.dumps([result.name, result.outcome, result.detail]) + "\n")
                results.flush()


if __name__ == "__main__":
    main(sys.argv[1])
