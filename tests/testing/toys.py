"""Toy methods: good ones that conform, and bad ones that each break one rule. Loaded as a plugin file."""

# ruff: noqa: NPY002, RUF012 - bad style is what the toys are for

import os
import signal
import sys
import time

import numpy as np
from scipy.spatial import cKDTree

from regbench import Registrar, Registration
from regbench.geometry.kabsch import kabsch
from regbench.geometry.se3 import se3, transform
from regbench.geometry.size import extent


def icp(problem):
    tree = cKDTree(problem.target)
    T = se3(np.eye(3), problem.target.mean(axis=0) - problem.source.mean(axis=0))
    for _ in range(30):
        _, matches = tree.query(transform(T, problem.source))
        T = kabsch(problem.source, problem.target[matches])
    return T


class Good(Registrar):
    name = "good"
    presets = {"fast": {"iterations": 5}}

    def __init__(self, *, iterations: int = 30, label: str | None = None):
        self.iterations = iterations
        self.label = label

    def register(self, problem):
        return Registration(T_target_source=icp(problem))


class DuckTyped:
    """Nothing but a name and register; it prints a lot, and answers a record of its own."""

    name = "duck"

    def register(self, problem):
        print("quack " * 100_000)
        return type("Answer", (), {"T_target_source": icp(problem).tolist()})()


class HonestlyRandom(Good):
    deterministic = False

    def register(self, problem):
        return nudged(problem, float(np.random.default_rng().uniform(0, 1e-9)))


class Sentinel(Good):
    kind = "sentinel"

    def register(self, problem):
        return Registration(T_target_source=np.eye(4))


class ChoosyButHonest(Good):
    def skip(self, problem):
        return "too few points" if len(problem.source) < 100 else None


def nudged(problem, by):
    T = icp(problem)
    T[0, 3] += by
    return Registration(T_target_source=T)


# Each class below breaks one rule; its comment names the check that must fail, and no other.


class NoName:  # interface
    def register(self, problem):
        return Registration(T_target_source=icp(problem))


class NameWithSpace(Good):  # interface
    name = "my method"


class NoRegister:  # interface
    name = "no_register"


class UnknownKind(Good):  # interface
    kind = "magic"


class PositionalParameter(Good):  # constructor
    def __init__(self, iterations=3):
        self.iterations = iterations


class NoDefault(Good):  # constructor
    def __init__(self, *, iterations):
        self.iterations = iterations


class StoresChanged(Good):  # constructor
    def __init__(self, *, iterations: int = 30):
        self.iterations = iterations + 1


class StoresNothing(Good):  # constructor
    def __init__(self, *, iterations: int = 30):
        pass


class StoresMore(Good):  # constructor
    def __init__(self, *, iterations: int = 30):
        self.iterations = iterations
        self.cache = {}


class WrongDefaultType(Good):  # parameters
    presets = {}

    def __init__(self, *, iterations: int = 2.5):
        self.iterations = iterations


class DefaultNotJson(Good):  # parameters
    presets = {}

    def __init__(self, *, weights=frozenset({1})):
        self.weights = weights


class ReprOfTwoLines(Good):  # parameters
    def __repr__(self):
        return "Good(\n)"


class PresetOfUnknownParameter(Good):  # presets
    presets = {"paper": {"iteration": 5}}


class PresetOfWrongType(Good):  # presets
    presets = {"paper": {"iterations": "many"}}


class NeedsWhatIsMissing(Good):  # requires
    requires = ("no_such_module_anywhere",)


class RequiresText(Good):  # requires
    requires = "numpy"


class WritesToInput(Good):  # inputs
    def register(self, problem):
        problem.source[0] = 0
        return super().register(problem)


class UnlocksInput(Good):  # inputs
    def register(self, problem):
        answer = super().register(problem)
        problem.target.flags.writeable = True
        problem.target[:] += 1e-9
        return answer


class AnswersNone(Good):  # answers
    def register(self, problem):
        return None


class AnswersReflection(Good):  # answers
    def register(self, problem):
        return Registration(T_target_source=np.diag([1.0, 1, -1, 1]))


class AnswersNan(Good):  # answers
    def register(self, problem):
        return Registration(T_target_source=np.full((4, 4), np.nan))


class Raises(Good):  # answers
    def register(self, problem):
        raise KeyError("missing weight")


class Exits(Good):  # answers
    def register(self, problem):
        sys.exit(3)


class AnswersIdentity(Good):  # accuracy
    def register(self, problem):
        return Registration(T_target_source=np.eye(4))


class MatchesByIndex(Good):  # point order
    def register(self, problem):
        count = min(len(problem.source), len(problem.target))
        return Registration(T_target_source=kabsch(problem.source[:count], problem.target[:count]))


class OnlyNearTheOrigin(Good):  # moved frame
    def register(self, problem):
        if np.abs(problem.target.mean(axis=0)).max() > 2 * extent(problem.target):
            return Registration(T_target_source=np.eye(4))
        return super().register(problem)


class ThinksInMetres(Good):  # scale
    def register(self, problem):
        if not 0.1 < extent(problem.target) < 10:
            return Registration(T_target_source=np.eye(4))
        return super().register(problem)


class NeverTheSame(Good):  # repeat
    def register(self, problem):
        return nudged(problem, int.from_bytes(os.urandom(4)) * 1e-18)


class CountsInstances(Good):  # fresh instance
    count = 0

    def prepare(self):
        type(self).count += 1
        self.number = self.count

    def register(self, problem):
        return nudged(problem, 1e-9 * self.number)


class RemembersLastProblem(Good):  # no memory
    def prepare(self):
        self.last_size = None

    def register(self, problem):
        changed = self.last_size not in (None, len(problem.source))
        self.last_size = len(problem.source)
        return nudged(problem, 1e-9 * changed)


class DependsOnProcess(Good):  # fresh process
    def register(self, problem):
        return nudged(problem, 1e-14 * os.getpid())


class DependsOnGlobalSeed(Good):  # seed
    def register(self, problem):
        seed = np.random.get_state()[1][0] % 2**31  # the seed that was set; 0 if none was
        return nudged(problem, 1e-9 * float(seed))


class SeedsGlobally(Good):  # random state
    def register(self, problem):
        np.random.seed(problem.seed)
        return nudged(problem, 1e-9 * np.random.uniform())


class RefusesLargeClouds(Good):  # sizes
    def register(self, problem):
        if len(problem.source) > 4000:
            raise MemoryError("too many points")
        return super().register(problem)


class TripsOverGivenStart(Good):  # optional inputs
    def register(self, problem):
        if problem.init_T_target_source is not None:
            raise NotImplementedError("a start")
        return super().register(problem)


class SilentOnDegenerate(Good):  # degenerate
    def register(self, problem):
        if len(problem.source) < 3:
            raise ValueError
        return super().register(problem)


class NanOnDegenerate(Good):  # degenerate
    def register(self, problem):
        if len(problem.source) < 3:
            return Registration(T_target_source=np.full((4, 4), np.nan))
        return super().register(problem)


class SkipsWithoutWords(Good):  # skip
    def skip(self, problem):
        return len(problem.source) < 3


class BatchInAnotherOrder(Good):  # batch
    def register_batch(self, problems):
        return [self.register(problem) for problem in reversed(problems[1:])] + [self.register(problems[0])]


class BatchForgetsOne(Good):  # batch
    def register_batch(self, problems):
        return [self.register(problem) for problem in problems[1:]]


# These need a process that may die.


class SegfaultsOnDegenerate(Good):
    def register(self, problem):
        if len(problem.source) < 3:
            os.kill(os.getpid(), signal.SIGSEGV)
        return super().register(problem)


class HangsOnDegenerate(Good):
    def register(self, problem):
        if len(problem.source) < 3:
            signal.signal(signal.SIGTERM, signal.SIG_IGN)
            time.sleep(600)
        return super().register(problem)


class AlwaysDies(Good):
    def register(self, problem):
        print("going down", file=sys.stderr)
        os._exit(7)
