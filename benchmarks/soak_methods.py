"""Methods that fail at random, as benchmarks/soak.py runs them; what goes wrong depends on the problem's seed alone."""

import ctypes
import os
import random
import signal
import time

import numpy as np

from regbench import Problem, Registration

CRASHES, HANGS = 0.05, 0.01
LEAK_MB = 16
_kept = []


def fault_of(seed: int) -> str:
    """Return what `unreliable` does on a problem of this seed: "" or a method that begins with crash or hang."""
    draw = random.Random(seed)
    kind = draw.random()
    if kind < CRASHES:
        return draw.choice(("crash_segfault", "crash_abort", "crash_exit", "crash_sigkill", "crash_with_child"))
    if kind < CRASHES + HANGS:
        return draw.choice(("hang_asleep", "hang_ignoring_sigterm", "hang_in_c_with_child"))
    return ""


def _child_that_would_outlive_us():
    if os.fork() == 0:
        time.sleep(1e6)


class Unreliable:
    """Crashes on 5 % of problems, hangs on 1 %, keeps 1 MB of every call."""

    name = "unreliable"

    def warm_up(self, problem):
        pass  # else the warm-up would crash in the trial's stead

    def register(self, problem: Problem) -> Registration:
        if fault := fault_of(problem.seed):
            getattr(self, fault)()
        _kept.append(bytearray(os.urandom(2**20)))
        return Registration(T_target_source=np.eye(4))

    def crash_segfault(self):
        ctypes.string_at(0)

    def crash_abort(self):
        os.abort()

    def crash_exit(self):
        os._exit(3)

    def crash_sigkill(self):
        os.kill(os.getpid(), signal.SIGKILL)

    def crash_with_child(self):
        _child_that_would_outlive_us()
        ctypes.string_at(0)

    def hang_asleep(self):
        time.sleep(1e6)

    def hang_ignoring_sigterm(self):
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        time.sleep(1e6)

    def hang_in_c_with_child(self):
        _child_that_would_outlive_us()
        ctypes.PyDLL(None).sleep(1_000_000)  # holds the GIL


class Leaks:
    """Keeps 16 MB of every call, until there is no memory left."""

    name = "leaks"

    def warm_up(self, problem):
        pass

    def register(self, problem: Problem) -> Registration:
        _kept.append(np.ones(LEAK_MB * 2**17))
        return Registration(T_target_source=np.eye(4))
