"""For authors of methods: the conformance battery.

from regbench.testing import assert_conforms

def test_my_method_conforms():
    assert_conforms(MyMethod)
"""

from regbench.testing.check_registrar import assert_conforms, check_registrar
from regbench.testing.check_result import CheckResult, Outcome

__all__ = ["CheckResult", "Outcome", "assert_conforms", "check_registrar"]
