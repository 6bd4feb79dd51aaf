from pathlib import Path

import pytest

from regbench.errors import UserError
from regbench.learning.training.folder import default_folder
from regbench.learning.training.recipe_files import find_recipe
from tests.learning.training.toy_training import Toy, toy_recipe


@pytest.fixture
def toy(tmp_path):
    for name in ("small", "large"):
        (tmp_path / f"{name}.toml").write_text("")
    return type("Toy", (Toy,), {"recipes": tmp_path})


def test_a_recipe_is_found_by_name_path_or_default(toy):
    assert find_recipe(toy, "toy", "large") == toy.recipes / "large.toml"
    assert find_recipe(toy, "toy", "some/other.toml") == Path("some/other.toml")
    toy.default_recipe = "small"
    assert find_recipe(toy, "toy", None) == toy.recipes / "small.toml"


def test_the_only_recipe_is_the_default(toy):
    (toy.recipes / "large.toml").unlink()
    assert find_recipe(toy, "toy", None) == toy.recipes / "small.toml"


def test_an_unknown_recipe_gets_a_did_you_mean(toy):
    with pytest.raises(UserError, match=r"unknown recipe 'smal' of method 'toy'; did you mean 'small'\?"):
        find_recipe(toy, "toy", "smal")


def test_several_recipes_need_a_name(toy):
    with pytest.raises(UserError, match=r"name a recipe: --recipe \(there: large, small\)"):
        find_recipe(toy, "toy", None)
    with pytest.raises(UserError, match=r"--recipe FILE.toml \(the method brings none\)"):
        find_recipe(Toy, "toy", None)


def test_the_default_folder_is_the_same_for_what_may_continue():
    def folder(start=None, **training):
        return default_folder("toy", "small", toy_recipe(**training), start)

    assert folder() == folder(loader_workers=2)
    assert folder().name.startswith("train-toy-small-")
    assert folder(schedule="constant") == folder(schedule="constant", steps=50)
    others = [folder(), folder(steps=50), folder(schedule="constant"), folder(method={"width": 5}), folder(Path("w"))]
    assert len(set(others)) == len(others)
