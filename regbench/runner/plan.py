"""What a run is to do: its configuration, and the trials in the order they are run."""

from __future__ import annotations

import hashlib
import random
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import orjson
from pydantic import BaseModel, ConfigDict, Field

from regbench.protocols.protocol import ProblemSet, Protocol
from regbench.registry import Method
from regbench.runner.fingerprint import method_fingerprint

BLOCK = 25


class RunConfig(BaseModel):
    """Every option of a run; the command line and a TOML file fill it."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    method: list[str] = Field(min_length=1)
    protocol: list[str] = Field(default=["demo@1"], min_length=1)
    limit: int | None = Field(default=None, ge=1)
    repeat: int = Field(default=1, ge=1)
    seed: int = Field(default=0, ge=0, lt=2**32)  # what NumPy's legacy generator takes
    timeout: float = Field(default=60.0, gt=0, allow_inf_nan=False)
    memory: float = Field(default=8.0, gt=0, le=2**20)
    jobs: int = Field(default=1, ge=1)
    threads: int = Field(default=1, ge=1)
    batch: int = Field(default=1, ge=1)
    device: str = Field(default="cpu", pattern=r"^(cpu|cuda(:\d+)?)$")
    executor: str = "local"
    scheduler: str | None = None
    data: str | None = None
    out: str | None = None
    plugin: list[str] = []
    fresh: bool = False


@dataclass(frozen=True, eq=False)
class PlannedMethod:
    """A method of a run, with the hash that says when its rows are stale."""

    method: Method
    fingerprint: str
    missing: str | None

    @property
    def takes_batches(self) -> bool:
        """Whether the method answers several problems at once."""
        return callable(getattr(self.method.cls, "register_batch", None))


@dataclass(frozen=True)
class ProtocolIdentity:
    """A protocol's name and version, the hash over its problems, and that of its data."""

    id: str
    sha256: str
    data_sha256: str


@dataclass(frozen=True, eq=False)
class PlannedProtocol:
    """A protocol of a run, opened, with the hash over its problems and the number that the run takes."""

    protocol: Protocol
    problems: ProblemSet
    sha256: str
    count: int

    @property
    def identity(self) -> ProtocolIdentity:
        """What stands for it where its problems are not at hand."""
        return ProtocolIdentity(self.protocol.id, self.sha256, self.problems.data_sha256)


@dataclass(frozen=True)
class Trial:
    """One method on one problem, once."""

    method: int
    protocol: int
    problem: int
    repeat: int
    key: str


@dataclass(frozen=True, eq=False)
class Plan:
    """All that a run is to do."""

    config: RunConfig
    methods: Sequence[PlannedMethod]
    protocols: Sequence[PlannedProtocol]
    data_dir: Path

    def key(self, method: int, protocol: int, problem: int, repeat: int) -> str:
        """Return the key of a trial: a hash of everything its answer depends on, so that only its equal replaces it.

        It is `digest` of a list, whose bytes orjson makes so fast that the whole takes a fifth of the time (1.6 against
        8.4 us, on a busy machine): a run may have a hundred million trials.
        """
        content = [
            self.methods[method].fingerprint,
            self.protocols[protocol].sha256,
            problem,
            repeat,
            self.config.seed,
            self.config.threads,
            self.config.device,
        ]
        if (size := self.batch_of(method)) > 1:
            content.append(size)  # the last bits of an answer may depend on what it was computed with
        return hashlib.sha256(orjson.dumps(content)).hexdigest()[:32]

    def batch_of(self, method: int) -> int:
        """Return how many problems a method answers at a time; see `RunConfig.batch`."""
        return self.config.batch if self.config.batch > 1 and self.methods[method].takes_batches else 1

    def blocks(self, done: set[str]) -> Iterator[list[Trial]]:
        """Yield the trials that have no row yet, in blocks of one method each.

        Rounds are interleaved: every method runs a block of problems before any method runs the next, so that a noisy
        hour on the machine falls on all of them alike. Within a round the order of methods is shuffled, by a seed.
        """
        order = list(range(len(self.methods)))
        block_size = max(BLOCK, self.config.batch)
        shuffle = random.Random(self.config.seed)
        for repeat in range(self.config.repeat):
            for protocol, planned in enumerate(self.protocols):
                for start in range(0, planned.count, block_size):
                    shuffle.shuffle(order)
                    problems = range(start, min(start + block_size, planned.count))
                    for method in order:
                        trials = [
                            Trial(method, protocol, problem, repeat, self.key(method, protocol, problem, repeat))
                            for problem in problems
                        ]
                        if block := [trial for trial in trials if trial.key not in done]:
                            yield block


def plan_method(method: Method) -> PlannedMethod:
    """Return the method with its fingerprint, and what it needs that is not installed."""
    missing = method.missing()
    packages = " ".join(missing).replace("_", "-")
    reason = f"needs {', '.join(missing)}: pip install {packages}" if missing else None
    return PlannedMethod(method, method_fingerprint(method), reason)
