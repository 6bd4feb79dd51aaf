import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel

from regbench.errors import UserError
from regbench.learning.training.recipe import Recipe, Training, load_recipe, parse_change, read_table, recipe_of
from regbench.learning.training.toml_text import toml_text

TEXT = """trains = "toy"
[training]
steps = 20
learning_rate = 1e-4
[method]
width = 8
[method.actions]
sigma_rad = 0.5
"""


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "small.toml"
    path.write_text(TEXT)
    return path


def test_a_recipe_is_read_with_defaults_for_what_it_leaves_out(path):
    recipe = load_recipe(path, "toy")
    assert recipe.training == Training(steps=20, learning_rate=1e-4)
    assert recipe.method == {"width": 8, "actions": {"sigma_rad": 0.5}}


def test_changes_go_over_the_file_and_leave_the_rest(path):
    changes = [
        ("training.steps", 5),
        ("training.schedule", "constant"),
        ("method.actions.sigma_rad", 1),
        ("method.k", 3),
    ]
    recipe = load_recipe(path, "toy", changes)
    assert (recipe.training.steps, recipe.training.schedule, recipe.training.learning_rate) == (5, "constant", 1e-4)
    assert recipe.method == {"width": 8, "actions": {"sigma_rad": 1}, "k": 3}


def test_what_is_written_reads_back(path, tmp_path):
    recipe = load_recipe(path, "toy", [("method.words", 'quo"te\n\\'), ("method.list", [1, 2.5, True])])
    (tmp_path / "again.toml").write_text(recipe.as_toml())
    assert load_recipe(tmp_path / "again.toml", "toy") == recipe


values = st.recursive(
    st.booleans()
    | st.integers(-(2**63), 2**63 - 1)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(st.characters(exclude_categories=["Cs"])),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text('ab." é', max_size=3), inner, max_size=3),
    max_leaves=8,
)


@given(st.dictionaries(st.text(st.characters(exclude_categories=["Cs"]), max_size=5), values, max_size=5))
def test_any_values_read_back_as_they_were(tables):
    assert tomllib.loads(toml_text(tables)) == tables


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            'trains = "toy"\n[training]\nlerning_rate = 1',
            "[training] unknown key 'lerning_rate'; did you mean 'learning_rate'?",
        ),
        ('trains = "toy"\n[training]\nsteps = 0', "[training] steps = 0: input should be greater than or equal to 1"),
        ('trains = "toy"\n[training]\nsteps = 1.5', "[training] steps = 1.5: "),
        ('trains = "toy"\n[training]\nschedule = "linear"', "'cosine' or 'constant'"),
        ('trains = "toy"\n[trainin]\nsteps = 1', "unknown key 'trainin'; did you mean 'training'?"),
        ('trains = "toy"\ntraining = 3', "training = 3 is not a table; write [training]"),
        ('trains = "other"', "trains = 'other', not \"toy\""),
        ("[training]\nsteps = 1", "trains = None"),
        ('trains = "toy"\n[method]\nday = 2026-01-01', "day = datetime.date(2026, 1, 1): only text"),
        ('trains = "toy"\n[method]\nx = nan', "x = nan: only text, finite numbers"),
        ("trains = ", "not a readable TOML file"),
    ],
)
def test_a_bad_recipe_is_refused_in_one_line(path, text, words):
    path.write_text(text)
    with pytest.raises(UserError) as error:
        load_recipe(path, "toy")
    assert words in str(error.value)
    assert "\n" not in str(error.value)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(UserError, match=r"gone\.toml"):
        load_recipe(tmp_path / "gone.toml", "toy")


@pytest.mark.parametrize(
    ("text", "change"),
    [
        ("training.learning_rate=3e-4", ("training.learning_rate", 3e-4)),
        ("training.schedule = constant", ("training.schedule", "constant")),
        ('method.name="a=b"', ("method.name", "a=b")),
        ("method.graph.k=[1, 2]", ("method.graph.k", [1, 2])),
        ("method.flag=true", ("method.flag", True)),
    ],
)
def test_a_change_is_a_toml_value_or_plain_text(text, change):
    assert parse_change(text) == change


@pytest.mark.parametrize("text", ["steps=3", "training=3", "training.steps", "other.x=1", "=", ""])
def test_a_change_without_table_or_value_is_refused(text):
    with pytest.raises(UserError, match=r"write training\.KEY=VALUE"):
        parse_change(text)


def test_a_change_inside_what_is_no_table_is_refused():
    with pytest.raises(UserError, match="width = 8 is not a table"):
        recipe_of({"trains": "toy", "method": {"width": 8}}, "toy", "recipe:", [("method.width.x", 1)])


class Settings(BaseModel):
    width: int = 4
    name: str


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"widht": 3}, "method 'toy': [method] unknown key 'widht'; did you mean 'width'?"),
        ({"name": "a", "width": "x"}, "[method] width = 'x'"),
        ({}, "[method] name: field required"),
    ],
)
def test_a_methods_own_table_is_read_the_same_way(values, words):
    with pytest.raises(UserError) as error:
        read_table(Settings, values, "method 'toy': [method]")
    assert words in str(error.value)


def test_the_docstring_names_every_field():
    for field in Training.model_fields:
        assert f"        {field}: " in (Training.__doc__ or "")


def test_a_recipe_is_json():
    import json

    recipe = Recipe("toy", Training(), {"a": [1]})
    assert json.loads(json.dumps(recipe.as_dict())) == recipe.as_dict()
