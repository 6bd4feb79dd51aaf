"""The battery: every check, its name, and the checks without which it means nothing."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from regbench.testing import checks_of_answers as answers
from regbench.testing import checks_of_form as form
from regbench.testing.check_result import CheckFailed, CheckResult, CheckSkipped, Outcome
from regbench.testing.subject import Subject


@dataclass(frozen=True)
class Check:
    """One check.

    Attributes:
        name: As it is printed.
        run: Returns what it measured in words, or raises CheckFailed or CheckSkipped.
        needs: Checks that must not have failed. So one fault is one failed check, not ten.
    """

    name: str
    run: Callable[[Subject], str]
    needs: tuple[str, ...] = ()


_FORM = ("interface", "constructor", "requires")
_ASKED = (*_FORM, "inputs", "answers")

BATTERY = (
    Check("interface", form.check_interface),
    Check("constructor", form.check_constructor, ("interface",)),
    Check("parameters", form.check_parameters, ("interface", "constructor")),
    Check("presets", form.check_presets, ("interface", "constructor")),
    Check("requires", form.check_requires, ("interface",)),
    Check("inputs", answers.check_inputs, _FORM),
    Check("answers", answers.check_answers, (*_FORM, "inputs")),
    Check("accuracy", answers.check_accuracy, _ASKED),
    Check("point order", answers.check_point_order, (*_ASKED, "accuracy")),
    Check("moved frame", answers.check_moved_frame, (*_ASKED, "accuracy")),
    Check("scale", answers.check_scale, (*_ASKED, "accuracy")),
    Check("repeat", answers.check_repeat, _ASKED),
    Check("fresh instance", answers.check_fresh_instance, (*_ASKED, "repeat")),
    Check("no memory", answers.check_no_memory, (*_ASKED, "repeat")),
    Check("fresh process", answers.check_fresh_process, (*_ASKED, "repeat", "fresh instance")),
    Check("seed", answers.check_seed, (*_ASKED, "repeat", "fresh instance")),
    Check("random state", answers.check_random_state, _ASKED),
    Check("sizes", answers.check_sizes, _ASKED),
    Check("optional inputs", answers.check_optional_inputs, _ASKED),
    Check("degenerate", answers.check_degenerate, _ASKED),
    Check("skip", answers.check_skip, _FORM),
    Check("batch", answers.check_batch, (*_ASKED, "repeat")),
    Check("threads", answers.check_threads, _ASKED),
)


def run_check(check: Check, subject: Subject, earlier: Mapping[str, CheckResult]) -> CheckResult:
    """Run one check in this process, unless one that it needs has failed.

    Args:
        check: The check.
        subject: The method under test.
        earlier: Results so far, by name.
    """
    for name in check.needs:
        if earlier[name].outcome is Outcome.FAILED:
            return CheckResult(check.name, Outcome.SKIPPED, f"needs '{name}', which failed")
    try:
        return CheckResult(check.name, Outcome.PASSED, check.run(subject))
    except CheckFailed as failed:
        return CheckResult(check.name, Outcome.FAILED, str(failed))
    except CheckSkipped as skipped:
        return CheckResult(check.name, Outcome.SKIPPED, str(skipped))
    except (Exception, SystemExit) as error:  # noqa: BLE001 - the method may raise anything
        words = " ".join(str(error).split())
        return CheckResult(check.name, Outcome.FAILED, f"raised {type(error).__name__}: {words}")
