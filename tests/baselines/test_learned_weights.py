"""The weights of the learned baselines: whole, of a known training, and of use on shapes they were not trained on."""

from pathlib import Path

import numpy as np
import pytest
import regbench_baselines

from regbench.learning.training.recipe_files import find_recipe
from regbench.learning.weights import load_weights
from regbench.metrics.rotation import rotation_error_deg
from regbench.protocols.demo import DEMO
from regbench.registry import MethodRegistry, TrainableRegistry, parse_methods

FOLDER = Path(regbench_baselines.__file__).parent
FILES = sorted(FOLDER.glob("*/weights/*.safetensors"))
IDS = [f"{path.parents[1].name}-{path.stem}" for path in FILES]


def method_of(path):
    return MethodRegistry([]).resolve(parse_methods([f"{path.parents[1].name}[weights={path.stem}]"])[0])


@pytest.mark.parametrize("path", FILES, ids=IDS)
def test_the_card_says_what_it_was_trained_on_and_under_8_mb(path):
    card = load_weights(path).card
    assert card["method"] == path.parents[1].name
    assert card["supervision"] in ("supervised", "unsupervised")
    assert card["data"]["clouds trained on"] > 0
    assert card["steps"] > 0
    assert path.stat().st_size < 8e6


@pytest.mark.parametrize("path", FILES, ids=IDS)
def test_the_recipe_beside_it_trained_it(path):
    name = path.parents[1].name
    assert find_recipe(TrainableRegistry([]).find(name), name, path.stem).is_file()
    assert load_weights(path).card["recipe"]["trains"] == name


@pytest.mark.parametrize(
    "path", [path for path in FILES if path.stem == "modelnet40"], ids=lambda path: path.parents[1].name
)
def test_they_align_shapes_of_another_kind(path):
    method = method_of(path)
    registrar = method.cls(**method.parameters)
    problems = DEMO.open(Path())
    errors, angles = [], []
    for index in range(0, len(problems), max(1, len(problems) // 12)):
        problem, pair = problems.problem(index, protocol=DEMO.id)
        answer = registrar.register(problem).T_target_source
        truth = pair.T_target_source[None, :3, :3]
        errors.append(rotation_error_deg(answer[None, :3, :3], truth)[0])
        angles.append(rotation_error_deg(np.eye(3)[None], truth)[0])
    assert np.median(errors) < 0.2 * np.median(angles), errors
