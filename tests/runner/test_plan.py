"""The plan of a run."""

from types import SimpleNamespace

from regbench.runner.fingerprint import digest
from regbench.runner.plan import Plan, PlannedMethod, PlannedProtocol, RunConfig


def test_a_key_is_the_digest_of_what_an_answer_depends_on():
    """However it is computed: the keys of journals that exist must stay what they are."""
    config = RunConfig(method=["x"], seed=7, threads=2, device="cuda:1")
    method = PlannedMethod(SimpleNamespace(asked="x"), "f" * 64, None)
    protocol = PlannedProtocol(SimpleNamespace(id="p@1"), None, "e" * 64, 20)
    plan = Plan(config, [method], [protocol], None)
    assert plan.key(0, 0, 17, 3) == digest(["f" * 64, "e" * 64, 17, 3, 7, 2, "cuda:1"])[:32]
    assert plan.key(0, 0, 0, 0) == digest(["f" * 64, "e" * 64, 0, 0, 7, 2, "cuda:1"])[:32]
