"""The worker: a process of its own in which one method lives. Run as `python -m regbench.runner.worker FD`.

It speaks JSON with the run over a socket: first what to set up, then one message a trial. Nothing heavy is imported
before affinity and limits are set, and nothing that a method answers is unpickled anywhere.
"""

from __future__ import annotations

import json
import math
import os
import sys
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable

    from regbench.contract import Problem
    from regbench.protocols.protocol import Pair, ProblemSet

Message = dict[str, Any]


def main() -> None:
    """Serve until the run closes the socket."""
    connection, process_id = Connection(int(sys.argv[1])), os.getpid()
    setup = json.loads(connection.recv_bytes())
    _confine(setup)
    try:
        worker = Worker(setup)
        reply: Message = {"status": "ok"}
    except Exception as error:  # noqa: BLE001 - whatever a method does while it prepares
        reply = failure(error)
    except SystemExit as error:
        reply = failure(error)
    connection.send_bytes(json.dumps(reply).encode())
    while reply["status"] == "ok":
        try:
            request = json.loads(connection.recv_bytes())
        except (EOFError, OSError):
            return
        answer = getattr(worker, request["do"])(request)
        if os.getpid() != process_id:
            os._exit(0)  # a child that a method forked and let return: two must not answer
        connection.send_bytes(json.dumps(answer, allow_nan=False).encode())


def _confine(setup: Message) -> None:
    """Set affinity, the memory limit and death with the run, before anything heavy is imported."""
    if setup["cores"] and hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, setup["cores"])
    if sys.platform.startswith("linux"):
        import ctypes
        import signal

        ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG: kill -9 of the run leaves no orphan
        if os.getppid() != setup["parent"]:
            sys.exit("the run is gone")
        import resource

        # RLIMIT_DATA counts private writable memory; unlike RLIMIT_AS it leaves CUDA's address ranges alone.
        resource.setrlimit(resource.RLIMIT_DATA, (setup["memory_bytes"], setup["memory_bytes"]))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    from regbench.compiled.cache import settle
    from regbench.native import load_libusb

    load_libusb()
    settle()


def failure(error: BaseException) -> Message:
    """Return the status and the words for what a method raised."""
    import traceback

    from regbench.errors import printable

    traceback.print_exception(error)  # to the worker's log
    if isinstance(error, MemoryError) or type(error).__name__ == "OutOfMemoryError":
        status = "oom"
    elif isinstance(error, ImportError):
        status = "missing"
    else:
        status = "error"
    words = printable(" ".join(str(error).split()))
    return {"status": status, "error": f"{type(error).__name__}: {words}"[:500] if words else type(error).__name__}


class Worker:
    """One method, prepared, and the protocols it has met."""

    def __init__(self, setup: Message) -> None:
        self._setup = setup
        # open3d must come before torch where a method needs both: their bundled libraries clash the other way round.
        for module in sorted(setup["requires"], key=lambda name: name != "open3d"):
            __import__(module)
        import gc

        from regbench.runner.clock import device_synchroniser

        self._method = _find(setup)
        self._optional("prepare")()
        self._synchronise = device_synchroniser(setup["device"])
        self._protocols: dict[str, ProblemSet] = {}
        gc.freeze()  # what is loaded by now is never garbage: collections between trials stay cheap

    def _optional(self, name: str) -> Callable[..., Any]:
        """Return an optional method of the contract, or the contract's default."""
        defaults: dict[str, Callable[..., Any]] = {
            "prepare": lambda: None,
            "warm_up": self._method.register,
            "skip": lambda problem: None,
        }
        found: Callable[..., Any] = getattr(self._method, name, defaults[name])
        return found

    def open(self, request: Message) -> Message:
        """Open a protocol's data, in no trial's time."""
        try:
            protocol = request["protocol"]
            self._protocols[protocol] = _open(protocol, self._setup, request["data_sha256"])
        except Exception as error:  # noqa: BLE001 - whatever data files do
            return failure(error)
        return {"status": "ok"}

    def _problem(self, request: Message) -> tuple[Problem, Pair]:
        protocol = request["protocol"]
        _seed_global_generators(request["seed"])
        return self._protocols[protocol].problem(
            request["problem"],
            protocol=protocol,
            seed=request["seed"],
            repeat=request["repeat"],
            threads=self._setup["threads"],
            device=self._setup["device"],
        )

    def warm_up(self, request: Message) -> Message:
        """Let the method run once outside the clock. What it raises here it will raise, and report, in the trial."""
        try:
            problem, _ = self._problem(request)
            if not self._optional("skip")(problem) and not self._sees_ground_truth():
                self._optional("warm_up")(problem)
        except Exception as error:  # noqa: BLE001 - see above
            if isinstance(error, MemoryError):
                return failure(error)
        except SystemExit:
            pass
        return {"status": "ok"}

    def _sees_ground_truth(self) -> bool:
        return bool(getattr(self._method, "sees_ground_truth", False))

    def trial(self, request: Message) -> Message:
        """Run one trial and return its part of the row."""
        from regbench.runner.clock import Clock

        try:
            problem, pair = self._problem(request)
            reason = self._optional("skip")(problem)
        except Exception as error:  # noqa: BLE001 - whatever a method or a data file does
            return failure(error)
        if not reason and self._sees_ground_truth() and pair.T_target_source is None:
            reason = "nobody knows this problem's ground truth"
        if reason:
            return {"status": "skipped", "error": str(reason)[:500]}
        clock = Clock(self._synchronise)
        try:
            with clock:
                if self._sees_ground_truth():
                    answer = self._method.register_with_truth(problem, pair.T_target_source)
                else:
                    answer = self._method.register(problem)
            outcome = _checked(answer)
        except Exception as error:  # noqa: BLE001 - whatever a method does
            outcome = failure(error)
        except SystemExit as error:
            outcome = failure(error)
        return outcome | vars(clock.measurement)

    def batch(self, request: Message) -> Message:
        """Run several problems of a protocol at once and return their parts of the rows."""
        outcomes: list[Message] = []
        asked = []
        try:
            for number in request["problems"]:
                problem, _ = self._problem({**request, "problem": number})
                if reason := self._optional("skip")(problem):
                    outcomes.append({"status": "skipped", "error": str(reason)[:500]})
                else:
                    outcomes.append({"status": "asked"})
                    asked.append(problem)
            answers = list(self._method.register_batch(asked)) if asked else []
            if len(answers) != len(asked):
                return {"status": "error", "error": f"{len(answers)} answers to {len(asked)} problems"}
            checked = iter([_checked(answer) for answer in answers])
        except Exception as error:  # noqa: BLE001 - whatever a method or a data file does
            return failure(error)
        except SystemExit as error:
            return failure(error)
        merged = [next(checked) if outcome["status"] == "asked" else outcome for outcome in outcomes]
        return {"status": "ok", "outcomes": merged}


def _find(setup: Message) -> Any:
    """Import the method's class where the run found it, and build it."""
    import importlib
    from operator import attrgetter
    from pathlib import Path

    from regbench.registry import import_file

    module = import_file(Path(setup["file"])) if setup["file"] else importlib.import_module(setup["module"])
    return attrgetter(setup["attribute"])(module)(**setup["parameters"])


def _open(protocol: str, setup: Message, data_sha256: str) -> ProblemSet:
    from pathlib import Path

    from regbench.errors import UserError
    from regbench.registry import find_protocol

    problems = find_protocol(protocol).open(Path(setup["data_dir"]))
    if problems.data_sha256 != data_sha256:
        raise UserError(f"protocol {protocol}: the data here differ from those that the run was planned on")
    return problems


def _seed_global_generators(seed: int) -> None:
    """Seed the generators that a method may reach for against the rules, so that its trials do not depend on order."""
    import random

    import numpy as np

    random.seed(seed)
    np.random.seed(seed)  # noqa: NPY002 - the legacy global is the point
    if "torch" in sys.modules:
        sys.modules["torch"].manual_seed(seed)


def _checked(answer: Any) -> Message:
    """Return the row's part for what `register` returned: ok, or invalid with what is wrong."""
    import numpy as np

    from regbench.geometry.se3 import why_not_rigid

    if not hasattr(answer, "T_target_source"):
        return {"status": "invalid", "error": f"returned {type(answer).__name__}, expected a Registration"}
    if (wrong := why_not_rigid(answer.T_target_source)) is not None:
        return {"status": "invalid", "error": f"T_target_source: {wrong}"}
    converged, iterations = getattr(answer, "converged", None), getattr(answer, "iterations", None)
    return {
        "status": "ok",
        "T_target_source": np.asarray(answer.T_target_source, dtype=np.float64).tolist(),
        "converged": None if converged is None else bool(converged),
        "iterations": None if iterations is None else int(iterations),
        "confidence": _finite(getattr(answer, "confidence", None)),
        "stages_s": {str(name): _finite(value) for name, value in (getattr(answer, "stages_s", None) or {}).items()},
        "facts": {str(name): _fact(value) for name, value in (getattr(answer, "facts", None) or {}).items()},
    }


def _fact(value: Any) -> bool | int | float | None:
    """Return a fact as JSON has it: true or false, a whole number, or a number; null where it is not finite."""
    import numpy as np

    if isinstance(value, bool | np.bool_):
        return bool(value)
    return int(value) if isinstance(value, int | np.integer) else _finite(value)


def _finite(value: Any) -> float | None:
    return float(value) if value is not None and math.isfinite(value) else None


if __name__ == "__main__":
    main()
