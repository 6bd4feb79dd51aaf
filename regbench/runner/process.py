"""The run's end of a worker: starts it, gives it one trial at a time, and kills it when it must.

A process of our own on a socket rather than a pool: the environment and the affinity are set before the interpreter
starts, a method that ignores SIGTERM is gone at once (pebble waits 3 s for it), its children die with it, and no
pickle crosses the border.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Sequence
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from regbench.registry import Method
from regbench.runner.status import Status

Message = dict[str, Any]

PREPARE_LIMIT_S = 300.0
LOG_LIMIT_BYTES = 10_000_000
TAIL_CHUNKS = 4
REPLY_LIMIT_BYTES = 64_000_000
REPLY_STALL_S = 5
WATCH_INTERVAL_S = 0.05

# Spinning threads of OpenMP starve the other core (REFERENCES: 474 ms against 7 ms for small_gicp).
THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


class WorkerProcess:
    """One method in a process of its own.

    Args:
        method: The method to prepare there.
        cores: CPU cores that the process is confined to; empty for all.
        threads: Threads it may use.
        device: "cpu" or "cuda".
        data_dir: Where prepared data sets are.
        memory_gb: Memory limit.
        log: File that takes what the method prints.

    Attributes:
        failed: Why the method could not be prepared, as part of a row, or None.
        alive: Whether the process can take another trial.
    """

    def __init__(
        self,
        *,
        method: Method,
        cores: Sequence[int],
        threads: int,
        device: str,
        data_dir: Path,
        memory_gb: float,
        log: Path,
    ) -> None:
        self._memory_bytes = int(memory_gb * 2**30)
        self._warm: set[str] = set()
        self._sent_ahead: Message | None = None
        self._log = log
        self._tail: deque[bytes] = deque(maxlen=TAIL_CHUNKS)
        ours, theirs = socket.socketpair()
        # A method that writes to the socket must not leave us waiting for the rest of what is no answer.
        ours.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, struct.pack("ll", REPLY_STALL_S, 0))
        environment = os.environ | {"OMP_WAIT_POLICY": "passive", "PYTHONUNBUFFERED": "1"}
        environment |= dict.fromkeys(THREAD_VARIABLES, str(threads))
        self._process = subprocess.Popen(
            # -P: a random.py in the folder where the user works is not the module that a method means.
            [sys.executable, "-P", "-m", "regbench.runner.worker", str(theirs.fileno())],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            env=environment,
            pass_fds=[theirs.fileno()],
            start_new_session=True,
        )
        theirs.close()
        self._connection = Connection(ours.detach())
        self._answered = select.poll()  # made once: Connection.poll makes a selector each time
        self._answered.register(self._connection.fileno(), select.POLLIN)
        self._drain = threading.Thread(target=self._drain_output, daemon=True)
        self._drain.start()
        self.alive = True
        self.failed: Message | None = None
        self._setup = {
            "cores": list(cores),
            "threads": threads,
            "device": device,
            "data_dir": str(data_dir),
            "memory_bytes": self._memory_bytes,
            "parent": os.getpid(),
            "requires": list(method.trait("requires")),
            "module": method.locator.module,
            "file": method.locator.file,
            "attribute": method.locator.attribute,
            "parameters": method.parameters,
        }

    def prepare(self) -> None:
        """Let the method import, load and compile; sets `failed` if it cannot."""
        reply = self._ask(self._setup, limit_s=PREPARE_LIMIT_S)
        if reply["status"] != "ok":
            self.failed = reply | {"error": f"while it prepared: {reply['error']}"}
            self.kill()

    def trial(self, request: Message, ahead: Message | None, timeout_s: float) -> Message:
        """Run one trial, after a warm-up where its protocol is new to the method; return its part of a row.

        Args:
            request: The trial.
            ahead: The trial that will be asked for next, or None. It is sent along, so that the worker goes on to it
                while this process writes the row. It took what the runner adds to a trial from 0.63 and 0.65 ms to
                0.52 and 0.57 (two runs each of benchmarks/bench_runner.py, on a busy machine).
            timeout_s: Seconds that it may take.
        """
        if (cold := self._warmed(request, timeout_s)) is not None:
            return cold
        messages = [] if self._sent_ahead == request else [request]
        self._sent_ahead = ahead if ahead is not None and ahead["protocol"] in self._warm else None
        if self._sent_ahead is not None:
            messages.append(self._sent_ahead)
        return self._ask(*({"do": "trial", **message} for message in messages), limit_s=timeout_s)

    def batch(self, requests: Sequence[Message], timeout_s: float) -> list[Message] | None:
        """Run trials of one protocol at once; return their parts of the rows, or None where they did not all come."""
        if self._warmed(requests[0], timeout_s) is not None:
            return None
        problems = [request["problem"] for request in requests]
        reply = self._ask({"do": "batch", **requests[0], "problems": problems}, limit_s=timeout_s)
        return reply["outcomes"] if reply["status"] == "ok" else None

    def _warmed(self, request: Message, timeout_s: float) -> Message | None:
        """Open a protocol's data and let the method warm up on it, once; return what went wrong, or None."""
        if request["protocol"] in self._warm:
            return None
        reply = self._ask({"do": "open", **request}, limit_s=PREPARE_LIMIT_S)
        if reply["status"] != "ok":
            return reply | {"error": f"while its data were opened: {reply['error']}"}
        reply = self._ask({"do": "warm_up", **request}, limit_s=timeout_s)
        if reply["status"] != "ok":
            return reply | {"error": f"while it warmed up: {reply['error']}"}
        self._warm.add(request["protocol"])
        return None

    def close(self) -> None:
        """Let an idle process go."""
        if self.alive:
            self._connection.close()
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(timeout=1)
        self.kill()

    def interrupt(self) -> None:
        """Kill the process from another thread; the thread that waits for it then finds it dead."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)

    def kill(self) -> None:
        """Kill the process and whatever it started, at once, and wait until it is gone."""
        self.alive = False
        self.interrupt()
        self._process.wait()
        self._connection.close()
        self._drain.join(timeout=1)

    def _ask(self, *messages: Message, limit_s: float) -> Message:
        """Send messages and wait for one answer; a death, a time-out and too much memory are answers too."""
        start = time.perf_counter()
        try:
            for message in messages:
                self._connection.send_bytes(json.dumps(message).encode())
            while not self._answered.poll(WATCH_INTERVAL_S * 1e3):
                waited_s = time.perf_counter() - start
                if waited_s > limit_s:
                    self.kill()
                    words = f"no answer after {limit_s:g} s; killed"
                    return {"status": "timeout", "error": words, "time_ms": waited_s * 1e3}
                if self._process.poll() is not None and not self._answered.poll(0):
                    return self._buried(start)
                if self._resident_bytes() > self._memory_bytes:
                    self.kill()
                    return {"status": "oom", "error": f"over the memory limit of {self._limit_words()}; killed"}
            reply = _read_reply(self._connection.recv_bytes(REPLY_LIMIT_BYTES))
        except (EOFError, OSError):
            return self._buried(start)
        except ValueError:
            self.kill()
            return {"status": "crashed", "error": "something other than an answer came from the worker"}
        if reply["status"] == "oom":
            self.kill()  # after a failed allocation a process is not to be trusted
            reply["error"] += f" (limit {self._limit_words()})"
        return reply

    def _buried(self, start: float) -> Message:
        """Return why the process died."""
        try:
            code = self._process.wait(timeout=1)
        except subprocess.TimeoutExpired:
            code = None
        self.kill()
        elapsed = {"time_ms": (time.perf_counter() - start) * 1e3}
        tail = b"".join(self._tail)  # of this process alone: the log may hold what earlier ones printed
        if b"bad_alloc" in tail or b"Cannot allocate memory" in tail:
            return {"status": "oom", "error": f"died without memory (limit {self._limit_words()})", **elapsed}
        if code is None:
            return {"status": "crashed", "error": "the process closed its connection or wrote to it", **elapsed}
        if code == -signal.SIGKILL:
            words = "killed by SIGKILL, not by regbench (the kernel, short of memory?)"
        elif code < 0:
            words = f"killed by {_signal_name(-code)}"
        else:
            words = f"the process ended with exit code {code}"
        return {"status": "crashed", "error": words, **elapsed}

    def _limit_words(self) -> str:
        return f"{self._memory_bytes / 2**30:g} GB"

    def _resident_bytes(self) -> int:
        try:
            pages = int(Path(f"/proc/{self._process.pid}/statm").read_text().split()[1])
        except (OSError, IndexError):  # it just died, or this is not Linux
            return 0
        return pages * os.sysconf("SC_PAGE_SIZE")

    def _drain_output(self) -> None:
        """Copy what the process prints to its log, up to a limit; beyond it, read on and drop."""
        assert self._process.stdout is not None
        with self._process.stdout as output, contextlib.ExitStack() as files:
            try:
                log = files.enter_context(self._log.open("ab", buffering=0))
                room = LOG_LIMIT_BYTES - log.tell()
            except OSError:  # no room on the disk or for so long a name: read on, for the method must not block
                room = 0
            while chunk := os.read(output.fileno(), 65536):
                self._tail.append(chunk[-2000:])
                if room > 0:
                    try:
                        log.write(chunk[:room])
                        room -= len(chunk)
                        if room <= 0:
                            log.write(b"\n[regbench: log limit reached, the rest is dropped]\n")
                    except OSError:  # a full disk: the journal will say so
                        room = 0


def _read_reply(content: bytes) -> Message:
    """Return a worker's reply.

    Raises:
        ValueError: It is none: something of the method's wrote to the socket, or changed what writes there.
    """
    reply = _REPLIES.decode(content.decode())
    if not isinstance(reply, dict) or reply.get("status") not in list(Status):
        raise ValueError("not a reply")
    return reply


def _refuse(constant: str) -> None:
    raise ValueError(f"{constant} in a reply")


_REPLIES = json.JSONDecoder(parse_constant=_refuse)


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:  # most of the real-time ones have no name
        return f"signal {number}"
