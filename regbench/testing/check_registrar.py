"""Runs the conformance battery on a method, in a process that may crash or hang without harm."""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from typing import IO

from regbench.errors import UserError
from regbench.testing.battery import BATTERY, run_check
from regbench.testing.check_result import CheckResult, Outcome
from regbench.testing.checks_of_answers import request
from regbench.testing.subject import Origin, Subject


def check_registrar(
    method_class: type, parameters: Mapping[str, object] | None = None, *, time_limit_s: float = 60.0
) -> list[CheckResult]:
    """Run the conformance battery on a method.

    The checks run in a process of their own on one core, as the runner's workers do, with a time limit each: a
    segfault or a hang is a failed check, and the battery goes on. A class made inside a function cannot be imported
    there; it is checked in this process, unshielded.

    Args:
        method_class: A class with a `name` and a `register` method; it need not derive from Registrar.
        parameters: Constructor arguments to check it with; what is not given keeps its default.
        time_limit_s: Seconds that one check may take.

    Returns:
        One result per check, in the battery's order.

    Raises:
        UserError: The parameters cannot be written as JSON.
    """
    return list(iterate_checks(method_class, parameters, time_limit_s=time_limit_s))


def iterate_checks(
    method_class: type, parameters: Mapping[str, object] | None = None, *, time_limit_s: float = 60.0
) -> Iterator[CheckResult]:
    """Yield the results of `check_registrar` one by one, as they come in."""
    subject = Subject(method_class, dict(parameters or {}))
    try:
        json.dumps(subject.parameters)
    except (TypeError, ValueError) as error:
        raise UserError(f"parameters of {method_class.__qualname__} cannot be written as JSON: {error}") from None
    origin = Origin.of(method_class)
    results: dict[str, CheckResult] = {}
    while len(results) < len(BATTERY):
        done = len(results)
        for result in (
            _in_this_process(subject) if origin is None else _in_a_child(origin, subject, results, time_limit_s)
        ):
            results[result.name] = result
            yield result
        if len(results) == done:
            raise RuntimeError("the battery made no progress")  # pragma: no cover - a child always ends one check


def assert_conforms(
    method_class: type, parameters: Mapping[str, object] | None = None, *, time_limit_s: float = 60.0
) -> None:
    """Assert that a method passes the conformance battery: one line in a plugin's tests.

    Raises:
        AssertionError: A check failed; the message lists every failed check with its reason.
    """
    results = check_registrar(method_class, parameters, time_limit_s=time_limit_s)
    failed = [f"{result.name}: {result.detail}" for result in results if result.outcome is Outcome.FAILED]
    if failed:
        raise AssertionError(f"{method_class.__qualname__} fails {len(failed)} check(s)\n  " + "\n  ".join(failed))


def _in_this_process(subject: Subject) -> Iterator[CheckResult]:
    results: dict[str, CheckResult] = {}
    for check in BATTERY:
        results[check.name] = run_check(check, subject, results)
        yield results[check.name]


def _in_a_child(
    origin: Origin, subject: Subject, earlier: Mapping[str, CheckResult], time_limit_s: float
) -> Iterator[CheckResult]:
    """Yield what one child finds, up to the end of the battery or to the check that it dies of."""
    remaining = [check.name for check in BATTERY if check.name not in earlier]
    reading_end, writing_end = os.pipe()
    with tempfile.TemporaryFile() as log, os.fdopen(reading_end, "rb", buffering=0) as results:
        with _on_one_core():
            child = subprocess.Popen(
                [sys.executable, "-m", "regbench.testing.child", "checks"],
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=log,
                pass_fds=(writing_end,),
                start_new_session=True,  # so that what the method itself started ends with it
            )
        os.close(writing_end)
        try:
            assert child.stdin is not None
            told = [(result.name, result.outcome, result.detail) for result in earlier.values()]
            child.stdin.write(request(origin, subject, earlier=told, results_fd=writing_end).encode())
            child.stdin.close()
            for name in remaining:
                line = _read_line(results.fileno(), time_limit_s)
                if line is None:
                    yield CheckResult(name, Outcome.FAILED, f"no end after {time_limit_s:g} s; the process was killed")
                    return
                if not line:
                    yield CheckResult(name, Outcome.FAILED, _how_it_died(child.wait(), log))
                    return
                found, outcome, detail = json.loads(line)
                yield CheckResult(found, Outcome(outcome), detail)
        finally:
            _kill(child)


@contextlib.contextmanager
def _on_one_core() -> Iterator[None]:
    """Start processes on one core, as the runner does for one thread: open3d sums in another order on two."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(cores)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, cores)


def _read_line(descriptor: int, time_limit_s: float) -> bytes | None:
    """Read one line from a pipe; empty at its end, None if it does not come in time."""
    deadline = time.monotonic() + time_limit_s
    line = b""
    while not line.endswith(b"\n"):
        ready, _, _ = select.select([descriptor], [], [], max(0.0, deadline - time.monotonic()))
        if not ready:
            return None
        # One byte at a time: what follows the line belongs to the next check. Lines are short and few.
        byte = os.read(descriptor, 1)
        if not byte:
            return b""
        line += byte
    return line


def _how_it_died(returncode: int, log: IO[bytes]) -> str:
    log.seek(0)
    lines = log.read().decode(errors="replace").split("\n")
    last = next((line.strip() for line in reversed(lines) if line.strip()), "it said nothing")
    if returncode < 0:
        return f"the process was killed by {signal.Signals(-returncode).name}: {last}"
    return f"the process ended with exit code {returncode}: {last}"


def _kill(child: subprocess.Popen[bytes]) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.killpg(child.pid, signal.SIGKILL)
    child.wait()
