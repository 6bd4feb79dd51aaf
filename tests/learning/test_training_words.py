"""What tables say of a learned method's training comes from its card."""

import json
import subprocess
import sys

import pytest

from regbench.learning.training_words import training_words
from regbench_latentcem.registrar import LatentCem

CARD = {
    "supervision": "supervised",
    "steps": 4000,
    "hours": 1.23,
    "device": "AMD EPYC, 1 thread",
    "recipe": {"training": {"batch": 16}},
}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({}, "supervised, 64,000 samples, 1.2 h on AMD EPYC, 1 thread"),
        ({"steps": 0}, "supervised, 1.2 h on AMD EPYC, 1 thread"),
        ({"supervision": "unsupervised"}, "unsupervised, 64,000 samples, 1.2 h on AMD EPYC, 1 thread"),
        ({"hours": 0.3155}, "supervised, 64,000 samples, 19 min on AMD EPYC, 1 thread"),
        (
            {"before": {"samples": 7600, "hours": 0.5}},
            "supervised, 71,600 samples, 1.7 h on AMD EPYC, 1 thread",
        ),
        (
            {"before": {"samples": 7600, "hours": 2.5, "hours_by_device": {"AMD EPYC, 1 thread": 0.5, "a GPU": 2.0}}},
            "supervised, 71,600 samples, 1.7 h on AMD EPYC, 1 thread and 2.0 h on a GPU",
        ),
        ({"before": "none"}, None),
        ({"recipe": 5}, None),
        ({"hours": "long"}, None),
    ],
)
def test_supervision_and_budget_are_said_or_nothing(tmp_path, change, words):
    (tmp_path / "a.json").write_text(json.dumps(CARD | change))
    assert training_words(tmp_path / "a.safetensors") == words


@pytest.mark.parametrize("text", ["", "[]", "{", '"text"'])
def test_a_damaged_card_says_nothing(tmp_path, text):
    (tmp_path / "a.json").write_text(text)
    assert training_words(tmp_path / "a.safetensors") is None
    assert training_words(tmp_path / "missing.safetensors") is None


@pytest.mark.parametrize("parameters", [{}, {"model": "equivariant"}])
def test_latentcems_cards_say_that_it_is_unsupervised(parameters):
    assert LatentCem(**parameters).training().startswith("unsupervised, ")


def test_saying_it_loads_no_torch():
    code = (
        "import sys; from regbench_latentcem.registrar import LatentCem; LatentCem().training(); "
        "assert 'torch' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
