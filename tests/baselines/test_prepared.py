"""After prepare() a method compiles nothing more: the time limit of a first trial is not for the compiler."""

import json
import subprocess
import sys

import pytest

# Prints the compiled functions of ours with their types: after prepare(), and then those that a registration added.
REGISTERS = """
import gc, json, sys
from pathlib import Path
from regbench.compiled.cache import settle
settle()
from numba.core.dispatcher import Dispatcher
from regbench.registry import MethodRegistry, find_protocol, parse_methods

def compiled():
    found = [one for one in gc.get_objects() if isinstance(one, Dispatcher)]
    return {
        f"{one.py_func.__module__}.{one.py_func.__name__}{types}"
        for one in found if one.py_func.__module__.startswith(("regbench", "baselines")) for types in one.signatures
    }

asked = MethodRegistry().resolve(parse_methods([sys.argv[1]])[0])
method = asked.cls(**asked.parameters)
method.prepare()
before = compiled()
problem, _ = find_protocol("demo@1").open(Path("data")).problem(0, protocol="demo@1")
method.register(problem)
print(json.dumps([sorted(before), sorted(compiled() - before)]))
"""


@pytest.mark.parametrize("asked", ["icp[backend=numba]", "icp_restarts", "goicp", "goicp[preset=partial]", "super4pcs"])
def test_prepare_compiles_all_that_a_registration_needs(asked):
    answer = subprocess.run([sys.executable, "-c", REGISTERS, asked], capture_output=True, text=True, check=True)
    before, added = json.loads(answer.stdout)
    assert before
    assert added == []
