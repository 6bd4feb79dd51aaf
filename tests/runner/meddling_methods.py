"""Methods that meddle with what lies between the worker and the run, on every problem with an odd seed."""

import ctypes
import json
import os
import signal
import time
from pathlib import Path

import numpy as np

from regbench import Problem, Registration

IDENTITY = Registration(T_target_source=np.eye(4))


class Meddling:
    def warm_up(self, problem: Problem) -> None:
        pass

    def register(self, problem: Problem) -> Registration:
        return self.meddle(problem) if problem.seed % 2 else IDENTITY


class ReturnsTwice(Meddling):
    """Forks, and lets the child return too."""

    name = "returns_twice"

    def meddle(self, problem):
        T = np.eye(4)
        if child := os.fork():
            os.waitpid(child, 0)
        else:
            T[0, 3] = 99
        return Registration(T_target_source=T)


class WritesEverywhere(Meddling):
    """Writes to every open file, the worker's socket among them: half a message, so that the run waits for the rest."""

    name = "writes_everywhere"

    def meddle(self, problem):
        for descriptor in range(3, 1024):  # an open file's number is the least that was free
            try:
                os.write(descriptor, b"\0\0\1\0{")
            except OSError:
                continue
        return IDENTITY


class WritesText(Meddling):
    """The same with text, which reads as the start of a message of 1.7 GB."""

    name = "writes_text"

    def meddle(self, problem):
        for descriptor in range(3, 1024):  # an open file's number is the least that was free
            try:
                os.write(descriptor, b"hello world\n")
            except OSError:
                continue
        return IDENTITY


class ClosesAll(Meddling):
    name = "closes_all"

    def meddle(self, problem):
        os.closerange(3, 1024)
        return IDENTITY


class ForgesNothing(Meddling):
    name = "forges_list"

    def meddle(self, problem):
        json.dumps = lambda *args, **options: "[]"
        return IDENTITY


class ForgesNan(Meddling):
    name = "forges_nan"

    def meddle(self, problem):
        json.dumps = lambda *args, **options: '{"status": "ok", "time_ms": NaN}'
        return IDENTITY


class ForgesStatus(Meddling):
    name = "forges_status"

    def meddle(self, problem):
        json.dumps = lambda *args, **options: '{"status": "splendid"}'
        return IDENTITY


class StopsItself(Meddling):
    name = "stops_itself"

    def meddle(self, problem):
        os.kill(os.getpid(), signal.SIGSTOP)
        return IDENTITY


class DiesOfOddSignal(Meddling):
    """Of a real-time signal, which has no name."""

    name = "dies_of_odd_signal"

    def meddle(self, problem):
        os.kill(os.getpid(), signal.SIGRTMIN + 6)
        time.sleep(10)


class RunsOutThenSegfaults(Meddling):
    """The first odd problem ends as std::bad_alloc does, the others segfault."""

    name = "runs_out_then_segfaults"

    def __init__(self, *, flag: str = ""):
        self.flag = flag

    def meddle(self, problem):
        if not Path(self.flag).exists():
            Path(self.flag).touch()
            os.write(2, b"terminate called after throwing an instance of 'std::bad_alloc'\n")
            os.abort()
        ctypes.string_at(0)


class Prints(Meddling):
    name = "prints"

    def __init__(self, *, note: str = ""):
        self.note = note

    def meddle(self, problem):
        print("a line for the log")
        return IDENTITY


class NeedsSubmodule:
    name = "needs_submodule"
    requires = ("a_package_that_nobody_has.part",)

    def register(self, problem):
        return IDENTITY


class HasPath:
    name = "has_path"

    def __init__(self, *, weights: object = Path("weights.npz")):
        self.weights = weights

    def register(self, problem):
        return IDENTITY
