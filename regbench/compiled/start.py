"""What a process pays before its first compiled answer. `python -m regbench.compiled.start` says it as JSON."""

from __future__ import annotations

import json
import sys
import time

from regbench.compiled.cache import settle


def main() -> None:
    """Import our ICP, align three points, and write the seconds, and whether numba loaded kept code or compiled."""
    settle()
    start = time.perf_counter()
    import numpy as np
    from numba.core.dispatcher import Dispatcher

    from regbench.geometry import icp, nearest_tree

    imported = time.perf_counter()
    icp.icp(np.eye(3), np.eye(3), np.eye(4))
    answered = time.perf_counter()
    values = [*vars(icp).values(), *vars(nearest_tree).values()]
    stats = [function.stats for function in {value for value in values if isinstance(value, Dispatcher)}]
    findings = {
        "folder": stats[0].cache_path,
        "import_s": imported - start,
        "first_answer_s": answered - imported,
        "loaded": sum(stat.cache_hits.total() for stat in stats),
        "compiled": sum(stat.cache_misses.total() for stat in stats),
    }
    sys.stdout.write(json.dumps(findings))


if __name__ == "__main__":
    main()
