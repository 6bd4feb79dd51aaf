from typing import Any, Literal

import pytest

from regbench.errors import UserError
from regbench.parameters import defaults_of, parameter_types, parameters_of, parse_value, resolve


class Swept:
    presets = {"paper": {"distance": 0.5, "metric": "plane"}}  # noqa: RUF012

    def __init__(
        self,
        *,
        distance: float = 1.0,
        count: int = 3,
        metric: Literal["point", "plane"] = "point",
        voxel: float | None = None,
        mutual: bool = False,
        label: str = "x",
        free=None,
    ):
        self.distance, self.count, self.metric, self.voxel = distance, count, metric, voxel
        self.mutual, self.label, self.free = mutual, label, free


class Bare:
    pass


def test_parameters_are_read_off_the_constructor_in_order():
    assert list(parameter_types(Swept)) == ["distance", "count", "metric", "voxel", "mutual", "label", "free"]
    assert parameter_types(Swept)["distance"] is float
    assert parameter_types(Swept)["free"] is Any
    assert defaults_of(Swept)["count"] == 3
    assert parameters_of(Swept(count=9))["count"] == 9
    assert parameter_types(Bare) == defaults_of(Bare) == parameters_of(Bare()) == {}


def test_annotations_written_as_text_are_evaluated():
    namespace = {}
    exec(
        "from __future__ import annotations\n"
        "class A:\n    def __init__(self, *, n: int = 1): self.n = n\n"
        "class B:\n    def __init__(self, *, n: OnlyForTypeCheckers = 1): self.n = n\n",
        namespace,
    )
    assert parameter_types(namespace["A"]) == {"n": int}
    assert parameter_types(namespace["B"]) == {"n": Any}
    assert resolve(namespace["B"], {"n": "7"}, "b") == {"n": 7}


def test_a_positional_parameter_or_one_without_default_is_refused():
    class Positional:
        def __init__(self, distance=1.0):
            pass

    class NoDefault:
        def __init__(self, *, distance):
            pass

    for method in (Positional, NoDefault):
        with pytest.raises(UserError, match="constructor parameter 'distance' must be keyword-only with a default"):
            parameter_types(method)


@pytest.mark.parametrize(
    ("text", "annotation", "value"),
    [
        ("0.5", float, 0.5),
        ("1e-3", float, 1e-3),
        ("2", float, 2.0),
        ("12", int, 12),
        ("True", bool, True),
        ("no", bool, False),
        ("none", float | None, None),
        ("0.1", float | None, 0.1),
        ("point", Literal["point", "plane"], "point"),
        ("2", Literal[1, 2], 2),
        ("text", str, "text"),
        ("12", str, "12"),
        ("3", int | str, 3),
        ("x3", int | str, "x3"),
        ("3", Any, 3),
        ("0.5", Any, 0.5),
        ("False", Any, False),
        ("None", Any, None),
        ("word", Any, "word"),
    ],
)
def test_values_are_read_as_their_annotation_says(text, annotation, value):
    read = parse_value(text, annotation)
    assert read == value
    assert type(read) is type(value)


@pytest.mark.parametrize(
    ("text", "annotation", "words"),
    [
        ("much", float, "expected a number"),
        ("2.5", int, "expected a whole number"),
        ("maybe", bool, "expected true or false"),
        ("line", Literal["point", "plane"], "expected one of point, plane"),
        ("much", float | None, "expected a number or none"),
        ("1", tuple[int, int], "cannot be set from text"),
    ],
)
def test_values_of_the_wrong_type_are_refused_with_what_is_expected(text, annotation, words):
    with pytest.raises(ValueError, match=words):
        parse_value(text, annotation)


def test_given_beats_preset_beats_default():
    values = resolve(Swept, {"preset": "paper", "distance": "0.1"}, "swept")
    assert (values["distance"], values["metric"], values["count"]) == (0.1, "plane", 3)
    assert resolve(Swept, {"preset": "default"}, "swept") == defaults_of(Swept)
    assert resolve(Swept, {}, "swept") == defaults_of(Swept)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"distanse": "1"}, "unknown parameter 'distanse' of method 'swept'; did you mean 'distance'?"),
        ({"preset": "papre"}, "unknown preset 'papre' of method 'swept'; did you mean 'paper'?"),
        ({"metric": "line"}, "method 'swept': parameter metric=line: expected one of point, plane"),
    ],
)
def test_what_cannot_be_resolved_is_said_in_one_line(given, words):
    with pytest.raises(UserError) as caught:
        resolve(Swept, given, "swept")
    assert str(caught.value).startswith(words)
    assert "\n" not in str(caught.value)
