"""Methods that go wrong, each in one way, on every problem with an odd seed; on the others they answer the identity."""

import ctypes
import os
import signal
import sys
import time

import numpy as np

from regbench import Problem, Registration

IDENTITY = Registration(T_target_source=np.eye(4))


class Good:
    name = "good"

    def register(self, problem: Problem) -> Registration:
        return IDENTITY


class Faulty:
    def register(self, problem):
        return self.go_wrong(problem) if problem.seed % 2 else IDENTITY


class Raises(Faulty):
    name = "raises"

    def go_wrong(self, problem):
        raise RuntimeError("on\npurpose\x1b[31m")


class Sleeps(Faulty):
    name = "sleeps"

    def go_wrong(self, problem):
        time.sleep(1e6)


class IgnoresSigterm(Faulty):
    name = "ignores_sigterm"

    def go_wrong(self, problem):
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        while True:
            time.sleep(1)


class Spins(Faulty):
    """Holds the GIL inside C code, with a child process that would outlive it."""

    name = "spins"

    def go_wrong(self, problem):
        if os.fork() == 0:
            time.sleep(1e6)
        ctypes.PyDLL(None).sleep(1000)


class Segfaults(Faulty):
    name = "segfaults"

    def go_wrong(self, problem):
        ctypes.string_at(0)


class Exits(Faulty):
    name = "exits"

    def go_wrong(self, problem):
        sys.exit("enough")


class ExitsHard(Faulty):
    name = "exits_hard"

    def go_wrong(self, problem):
        os._exit(3)


class Allocates(Faulty):
    name = "allocates"

    def go_wrong(self, problem):
        kept = []
        while True:
            kept.append(bytearray(20_000_000))


class Prints(Faulty):
    name = "prints"

    def go_wrong(self, problem):
        for _ in range(300):
            print("x" * 100_000)
        return IDENTITY


class AnswersNan(Faulty):
    name = "answers_nan"

    def go_wrong(self, problem):
        return Registration(T_target_source=np.full((4, 4), np.nan))


class AnswersReflection(Faulty):
    name = "answers_reflection"

    def go_wrong(self, problem):
        return Registration(T_target_source=np.diag([1.0, 1.0, -1.0, 1.0]))


class AnswersWrongShape(Faulty):
    name = "answers_wrong_shape"

    def go_wrong(self, problem):
        return Registration(T_target_source=np.eye(3))


class AnswersNone(Faulty):
    name = "answers_none"

    def go_wrong(self, problem):
        return None


class AnswersText(Faulty):
    name = "answers_text"

    def go_wrong(self, problem):
        return Registration(T_target_source="identity", confidence=float("nan"))


class Skips:
    name = "skips"

    def skip(self, problem):
        return "odd seeds are not for me" if problem.seed % 2 else None

    def register(self, problem):
        return IDENTITY


class Needs:
    name = "needs"
    requires = ("a_package_that_nobody_has",)

    def register(self, problem):
        return IDENTITY


class FailsToPrepare:
    name = "fails_to_prepare"

    def prepare(self):
        raise FileNotFoundError("weights.safetensors")

    def register(self, problem):
        return IDENTITY


class DiesWhilePreparing:
    name = "dies_while_preparing"

    def prepare(self):
        os.kill(os.getpid(), signal.SIGSEGV)

    def register(self, problem):
        return IDENTITY
