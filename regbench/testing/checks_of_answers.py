"""Checks of what a method answers. Each returns what it measured, in words."""

from __future__ import annotations

import base64
import json
import random
import subprocess
import sys
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from regbench.contract import Problem
from regbench.geometry.se3 import transform
from regbench.testing import clouds
from regbench.testing.check_result import CheckFailed, CheckSkipped
from regbench.testing.subject import Origin, Subject, difference, errors, loaded, same_bits

# How far an answer in a batch may be from the same problem's alone: its last bits depend on what is computed with it.
BATCH_DEG = 0.1
BATCH_EXTENTS = 1e-3

ARRAYS = ("source", "target", "source_normals", "target_normals", "init_T_target_source")


def check_inputs(subject: Subject) -> str:
    """The problem's arrays are as they were, and are not written to."""
    problem, truth = clouds.easy_problem()
    before = {name: None if (a := getattr(problem, name)) is None else a.copy() for name in ARRAYS}
    try:
        subject.ask(subject.build(), problem, truth)
        words = "unchanged"
    except CheckSkipped:
        raise
    except (Exception, SystemExit) as error:  # noqa: BLE001 - other errors are for the check `answers`
        if "read-only" in str(error) or "not writeable" in str(error):
            raise CheckFailed(f"the method writes to its input: {error}; work on a copy") from None
        words = "unchanged (register did not answer)"
    for name, copy in before.items():
        after = getattr(problem, name)
        if copy is not None and not (after.shape == copy.shape and same_bits(after, copy)):
            raise CheckFailed(f"problem.{name} was modified")
    return words


def check_answers(subject: Subject) -> str:
    """An easy problem is answered by a motion in SE(3)."""
    problem, truth = clouds.easy_problem()
    subject.ask(subject.build(), problem, truth)
    return "answers a rigid motion"


def check_accuracy(subject: Subject) -> str:
    """The answer to an easy problem is close to the truth."""
    return _require_quality(subject, "easy problem", *clouds.easy_problem())


def check_point_order(subject: Subject) -> str:
    """The order of the points does not matter: each cloud is permuted on its own."""
    return _require_quality(subject, "both clouds permuted", *clouds.permuted_problem())


def check_moved_frame(subject: Subject) -> str:
    """Where the clouds lie does not matter: both are moved by one motion, about ten extents away."""
    return _require_quality(subject, "both clouds moved together", *clouds.moved_problem())


def check_scale(subject: Subject) -> str:
    """The unit of length does not matter."""
    return "; ".join(
        _require_quality(subject, f"clouds scaled by {factor:g}", *clouds.scaled_problem(factor))
        for factor in (0.01, 100.0)
    )


def check_repeat(subject: Subject) -> str:
    """The same problem gives the same bits again from the same instance."""
    problem, truth = clouds.easy_problem()
    instance = subject.build()
    first, second = (subject.ask(instance, problem, truth) for _ in range(2))
    return _require_same(subject, first, second, "a second call of register")


def check_fresh_instance(subject: Subject) -> str:
    """The same problem gives the same bits from another instance."""
    problem, truth = clouds.easy_problem()
    first, second = (subject.ask(subject.build(), problem, truth) for _ in range(2))
    return _require_same(subject, first, second, "a second instance")


def check_no_memory(subject: Subject) -> str:
    """The same problem gives the same bits after another problem was registered in between."""
    problem, truth = clouds.easy_problem()
    other, other_truth = clouds.easy_problem(450, cloud_seed=3, seed=8)
    instance = subject.build()
    first = subject.ask(instance, problem, truth)
    subject.ask(instance, other, other_truth)
    return _require_same(subject, first, subject.ask(instance, problem, truth), "another problem in between")


def check_fresh_process(subject: Subject) -> str:
    """The same problem gives the same bits in a process of its own."""
    origin = Origin.of(subject.method_class)
    if origin is None:
        raise CheckSkipped("the class lives inside a function: no other process can import it")
    problem, truth = clouds.easy_problem()
    here = subject.ask(subject.build(), problem, truth)
    process = subprocess.run(
        [sys.executable, "-m", "regbench.testing.child", "answer"],
        input=request(origin, subject),
        capture_output=True,
        text=True,
        check=False,
    )
    last = process.stdout.splitlines()[-1] if process.stdout.strip() else ""
    if process.returncode != 0:
        reason = process.stderr.splitlines()[-1] if process.stderr.strip() else f"exit code {process.returncode}"
        raise CheckFailed(f"a fresh process gives no answer: {reason}")
    there = np.frombuffer(base64.b64decode(last)).reshape(4, 4)
    return _require_same(subject, here, there, "a fresh process")


def check_seed(subject: Subject) -> str:
    """Random choices come from problem.seed: the state of global generators makes no difference."""
    problem, truth = clouds.easy_problem()
    answers = []
    for state in (1, 2):
        saved = _global_states()
        try:
            _seed_globally(state)
            answers.append(subject.ask(subject.build(), problem, truth))
        finally:
            _restore(saved)
    return _require_same(subject, answers[0], answers[1], "other global random seeds")


def check_random_state(subject: Subject) -> str:
    """The global random generators (random, numpy.random, torch) are as they were."""
    problem, truth = clouds.easy_problem()
    instance = subject.build()
    saved = _global_states()
    try:
        # A state that no method leaves behind: one that seeds with problem.seed has done so in an earlier check too.
        _seed_globally(20_011)
        before = _global_states()
        subject.ask(instance, problem, truth)
        after = _global_states()
    finally:
        _restore(saved)
    touched = [name for name in before if before[name] != after[name]]
    if touched:
        raise CheckFailed(f"register changes the global state of {', '.join(touched)}; use a generator of its own")
    return f"untouched: {', '.join(before)}"


def check_sizes(subject: Subject) -> str:
    """Clouds of different and extreme sizes get a motion in SE(3): 10 to 5,000 points."""
    sizes = ((10, 12), (300, 500), (10, 5000), (5000, 10), (5000, 4000))
    instance = subject.build()
    for source_count, target_count in sizes:
        target = transform(clouds.EASY_T_TARGET_SOURCE, clouds.body(target_count, seed=1))
        problem = clouds.make_problem(clouds.body(source_count), target)
        _ask(subject, instance, problem, f"{source_count} source and {target_count} target points")
    return ", ".join(f"{n} x {m}" for n, m in sizes)


def check_optional_inputs(subject: Subject) -> str:
    """A start or normals given by the problem, and no motion prior, do no harm."""
    problem, truth = clouds.easy_problem()
    normals = problem.source / np.linalg.norm(problem.source, axis=1, keepdims=True)
    given = {
        "a start": clouds.make_problem(problem.source, problem.target, init_T_target_source=truth),
        "normals": Problem(
            source=problem.source,
            target=problem.target,
            source_normals=normals,
            target_normals=normals @ truth[:3, :3].T,
            motion_prior=problem.motion_prior,
        ),
        "no motion prior": clouds.make_problem(problem.source, problem.target, prior=None),
    }
    instance = subject.build()
    declined = []
    for what, variant in given.items():
        try:
            _ask(subject, instance, variant, what)
        except CheckSkipped:
            declined.append(what)
    fine = [what for what in given if what not in declined]
    return f"fine with {', '.join(fine) or 'none'}" + (f"; declines {', '.join(declined)}" if declined else "")


def check_degenerate(subject: Subject) -> str:
    """Clouds without one answer get a motion in SE(3), or an exception that says what is wrong."""
    instance = subject.build()
    words = []
    for name, problem in clouds.degenerate_problems().items():
        try:
            _ask(subject, instance, problem, name)
            words.append(f"{name}: answered")
        except CheckSkipped:
            words.append(f"{name}: declined")
        except CheckFailed:
            raise
        except Exception as error:  # noqa: BLE001 - any ordinary exception will do
            if not str(error).strip():
                raise CheckFailed(f"{name}: raises {type(error).__name__} without a message") from None
            words.append(f"{name}: {type(error).__name__}")
    return ", ".join(words)


def check_skip(subject: Subject) -> str:
    """`skip` gives a reason in words, or None."""
    instance = subject.build()
    skip = getattr(instance, "skip", None)
    if not callable(skip):
        raise CheckSkipped("the method has no `skip`")
    problem, _ = clouds.easy_problem()
    no_prior = clouds.make_problem(problem.source, problem.target, prior=None)
    for variant in (problem, no_prior, *clouds.degenerate_problems().values()):
        reason = skip(variant)
        if not (reason is None or (isinstance(reason, str) and reason.strip())):
            raise CheckFailed(f"skip returns a reason in words or None, got {reason!r}")
    return "a reason or None"


def check_batch(subject: Subject) -> str:
    """`register_batch` answers each of several problems as `register` does."""
    instance = subject.build()
    if not callable(getattr(instance, "register_batch", None)):
        raise CheckSkipped("the method has no `register_batch`")
    asked = [clouds.easy_problem(), clouds.easy_problem(450, cloud_seed=3, seed=8), clouds.scaled_problem(100.0)]
    alone = [subject.ask(instance, problem, truth) for problem, truth in asked]
    together = list(instance.register_batch([problem for problem, _ in asked]))
    if len(together) != len(asked):
        raise CheckFailed(f"register_batch gives {len(together)} answers to {len(asked)} problems")
    apart = [
        errors(np.asarray(found.T_target_source, dtype=np.float64), problem, expected)
        for found, (problem, _), expected in zip(together, asked, alone, strict=True)
    ]
    rotation_deg, translation = (max(values) for values in zip(*apart, strict=True))
    words = f"{len(asked)} problems at once: {rotation_deg:.2g} deg and {translation:.2g} extents from each alone"
    if not subject.trait("deterministic"):
        raise CheckSkipped(f"the method does not claim to be deterministic ({words})")
    if rotation_deg > BATCH_DEG or translation > BATCH_EXTENTS:
        raise CheckFailed(f"{words} (allowed: {BATCH_DEG:g} deg, {BATCH_EXTENTS:g} extents)")
    return words


def check_threads(subject: Subject) -> str:
    """Report only: how much processor time a call takes for each second when one thread is asked for."""
    problem, truth = clouds.easy_problem(2000)
    instance = subject.build()
    subject.ask(instance, problem, truth)
    wall, cpu = time.perf_counter(), time.process_time()
    subject.ask(instance, problem, truth)
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    return f"2000 points: {wall * 1e3:.3g} ms, {cpu / wall:.2g} processors busy (threads=1)"


def request(origin: Origin, subject: Subject, **more: object) -> str:
    """Return what `python -m regbench.testing.child` reads: the method, its parameters, and where to import from."""
    return json.dumps({"origin": vars(origin), "parameters": dict(subject.parameters), "path": sys.path, **more})


def _ask(subject: Subject, instance: Any, problem: Problem, what: str) -> NDArray[np.float64]:
    try:
        return subject.ask(instance, problem, clouds.EASY_T_TARGET_SOURCE)
    except CheckFailed as failed:
        raise CheckFailed(f"{what}: {failed}") from None


def _require_quality(subject: Subject, what: str, problem: Problem, truth: NDArray[np.float64]) -> str:
    if subject.trait("kind") == "sentinel":
        raise CheckSkipped("a sentinel need not be accurate")
    return subject.require_close(what, subject.ask(subject.build(), problem, truth), problem, truth)


def _require_same(subject: Subject, first: NDArray[np.float64], second: NDArray[np.float64], after: str) -> str:
    same = same_bits(first, second)
    if not subject.trait("deterministic"):
        measured = "the same bits" if same else difference(first, second)
        raise CheckSkipped(f"the method does not claim to be deterministic (measured after {after}: {measured})")
    if not same:
        raise CheckFailed(f"claims to be deterministic, but {after} gives another answer: {difference(first, second)}")
    return f"same bits after {after}"


def _seed_globally(seed: int) -> None:
    random.seed(seed)
    np.random.seed(seed)  # noqa: NPY002 - the global generator is what is looked at
    if torch := loaded("torch"):
        torch.manual_seed(seed)


def _global_states() -> dict[str, Any]:
    states: dict[str, Any] = {"random": random.getstate(), "numpy.random": _numpy_state()}
    if torch := loaded("torch"):
        states["torch"] = torch.get_rng_state().numpy().tobytes()
    return states


def _numpy_state() -> tuple[Any, ...]:
    name, keys, *rest = np.random.get_state(legacy=True)  # noqa: NPY002
    return (name, np.asarray(keys).tobytes(), *rest)


def _restore(states: dict[str, Any]) -> None:
    random.setstate(states["random"])
    name, keys, *rest = states["numpy.random"]
    np.random.set_state((name, np.frombuffer(keys, dtype=np.uint32), *rest))  # noqa: NPY002
    if "torch" in states:
        torch = loaded("torch")
        torch.set_rng_state(torch.frombuffer(bytearray(states["torch"]), dtype=torch.uint8))
