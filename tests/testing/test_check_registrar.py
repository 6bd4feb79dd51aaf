import re
from pathlib import Path

import pytest

from regbench.errors import UserError
from regbench.registry import import_file
from regbench.testing import Outcome, assert_conforms, check_registrar
from regbench.testing.battery import BATTERY
from regbench.testing.check_registrar import _in_this_process
from regbench.testing.subject import Origin, Subject

TOYS = Path(__file__).with_name("toys.py")
toys = import_file(TOYS)

# The check that each bad toy must fail stands beside it, in a comment.
BAD = re.findall(r"^class (\w+)[(:].*# ([a-z ]+)$", TOYS.read_text(), flags=re.MULTILINE)


def failed(results):
    return {result.name: result.detail for result in results if result.outcome is Outcome.FAILED}


@pytest.mark.parametrize("name", ["DuckTyped", "HonestlyRandom", "Sentinel", "ChoosyButHonest"])
def test_a_good_method_conforms(name):
    results = check_registrar(getattr(toys, name))
    assert failed(results) == {}
    assert [result.name for result in results] == [check.name for check in BATTERY]
    assert all(result.detail for result in results)


def test_the_list_of_bad_toys_was_read():
    assert len(BAD) > 30
    checks = {check.name for check in BATTERY}
    assert {check for _, check in BAD} == checks - {"threads"}  # which only reports


@pytest.mark.parametrize(("name", "check"), BAD)
def test_a_bad_method_fails_exactly_the_check_for_its_fault(name, check):
    results = list(_in_this_process(Subject(getattr(toys, name), {})))
    assert set(failed(results)) == {check}


def test_a_segfault_is_a_failed_check_and_the_battery_goes_on():
    results = check_registrar(toys.SegfaultsOnDegenerate)
    assert set(failed(results)) == {"degenerate"}
    assert "SIGSEGV" in failed(results)["degenerate"]
    assert [result.name for result in results] == [check.name for check in BATTERY]


def test_a_hang_that_ignores_sigterm_is_a_failed_check_and_the_battery_goes_on():
    results = check_registrar(toys.HangsOnDegenerate, time_limit_s=5)
    assert set(failed(results)) == {"degenerate"}
    assert "no end after 5 s" in failed(results)["degenerate"]
    assert results[-1].outcome is Outcome.PASSED


def test_a_method_that_always_dies_fails_once_with_its_last_words():
    results = check_registrar(toys.AlwaysDies)
    assert failed(results) == {"inputs": "the process ended with exit code 7: going down"}
    assert all(r.detail == "needs 'inputs', which failed" for r in results if r.outcome is Outcome.SKIPPED)


def test_a_class_inside_a_function_is_checked_without_a_process_of_its_own():
    class Local(toys.Good):
        name = "local"

    assert Origin.of(Local) is None
    results = {result.name: result for result in check_registrar(Local)}
    assert failed(results.values()) == {}
    assert results["fresh process"].outcome is Outcome.SKIPPED


def test_parameters_reach_the_method():
    results = {result.name: result for result in check_registrar(toys.Good, {"iterations": 7})}
    assert results["parameters"].detail == "Good(iterations=7, label=None)"
    assert set(failed(_in_this_process(Subject(toys.Good, {"iterations": "seven"})))) == {"parameters"}
    with pytest.raises(UserError, match="cannot be written as JSON"):
        check_registrar(toys.Good, {"iterations": object()})


def test_assert_conforms_names_every_failed_check():
    with pytest.raises(AssertionError, match=r"(?s)AnswersIdentity fails 1 check\(s\).*accuracy: easy problem: off by"):
        assert_conforms(toys.AnswersIdentity)


def test_a_sentinel_may_be_wrong_and_says_so():
    results = {result.name: result for result in _in_this_process(Subject(toys.Sentinel, {}))}
    assert results["accuracy"].detail == "a sentinel need not be accurate"
