"""A method's parameters: read off its constructor, parsed from text, checked against their annotations."""

from __future__ import annotations

import inspect
import json
import types
from collections.abc import Mapping
from typing import Any, Literal, Union, get_args, get_origin

from regbench.errors import UserError


def parameter_types(method: type) -> dict[str, Any]:
    """Return the constructor's parameters and their annotations (`Any` where there is none), in order.

    Raises:
        UserError: A parameter is not keyword-only or has no default.
    """
    for parameter in _parameters(method):
        if parameter.kind is not parameter.KEYWORD_ONLY or parameter.default is parameter.empty:
            raise UserError(
                f"method class {method.__qualname__}: constructor parameter '{parameter.name}' must be keyword-only "
                "with a default; write `def __init__(self, *, name=default)`"
            )
    return {
        # An annotation that could not be evaluated is still text.
        parameter.name: Any
        if parameter.annotation is parameter.empty or isinstance(parameter.annotation, str)
        else parameter.annotation
        for parameter in _parameters(method)
    }


def defaults_of(method: type) -> dict[str, object]:
    """Return the constructor's defaults by name."""
    return {parameter.name: parameter.default for parameter in _parameters(method)}


def _parameters(method: type) -> list[inspect.Parameter]:
    try:
        signature = inspect.signature(method, eval_str=True)
    except NameError:  # an annotation that only a type checker can see
        signature = inspect.signature(method)
    return list(signature.parameters.values())


def parameters_of(method: object) -> dict[str, object]:
    """Return the values that an instance was built with; the contract stores them under their own names."""
    return {name: getattr(method, name) for name in defaults_of(type(method))}


def parse_value(text: str, annotation: Any) -> object:
    """Read one parameter value from text as its annotation says.

    Raises:
        ValueError: The text is not of that type; the message says what is expected.
    """
    origin = get_origin(annotation)
    if origin in (Union, types.UnionType):
        choices = get_args(annotation)
        if type(None) in choices and text.lower() == "none":
            return None
        for choice in (choice for choice in choices if choice is not type(None)):
            try:
                return parse_value(text, choice)
            except ValueError:
                continue
        raise ValueError(f"expected {_words(annotation)}")
    if origin is Literal:
        for choice in get_args(annotation):
            if text == str(choice):
                return choice
        raise ValueError(f"expected {_words(annotation)}")
    if annotation is bool:
        if text.lower() in ("true", "yes", "1"):
            return True
        if text.lower() in ("false", "no", "0"):
            return False
        raise ValueError("expected true or false")
    if annotation in (int, float):
        try:
            return annotation(text)
        except ValueError:
            raise ValueError("expected a whole number" if annotation is int else "expected a number") from None
    if annotation is Any:
        return _guess(text)
    if annotation is str:
        return text
    raise ValueError(f"cannot be set from text (its type is {annotation})")


def _guess(text: str) -> object:
    """Read a value whose type is not declared: a number, true/false/none, else the text itself."""
    for read in (int, float):
        try:
            return read(text)
        except ValueError:
            continue
    return {"true": True, "false": False, "none": None}.get(text.lower(), text)


def _words(annotation: Any) -> str:
    if get_origin(annotation) is Literal:
        return "one of " + ", ".join(str(choice) for choice in get_args(annotation))
    names = {int: "a whole number", float: "a number", type(None): "none", bool: "true or false", str: "text"}
    return " or ".join(
        _words(choice) if get_origin(choice) else names.get(choice, str(choice)) for choice in get_args(annotation)
    )


def resolve(method: type, given: Mapping[str, str], name: str) -> dict[str, object]:
    """Return every parameter's value: defaults, then the preset, then what was given.

    Raises:
        UserError: An unknown parameter or preset, or a value of the wrong type, or of one that JSON has not.
    """
    from regbench.suggest import unknown

    annotations = parameter_types(method)
    presets: Mapping[str, Mapping[str, object]] = getattr(method, "presets", {})
    values = defaults_of(method)
    given = dict(given)
    preset = given.pop("preset", None)
    if preset is not None and preset != "default":
        if preset not in presets:
            raise UserError(unknown("preset", preset, ["default", *presets], of=f"method '{name}'"))
        values.update(presets[preset])
    for key, text in given.items():
        if key not in annotations:
            raise UserError(unknown("parameter", key, [*annotations, "preset"], of=f"method '{name}'"))
        try:
            values[key] = parse_value(text, annotations[key])
        except ValueError as error:
            raise UserError(f"method '{name}': parameter {key}={text}: {error}") from None
    for key, value in values.items():
        try:
            json.dumps(value)
        except (TypeError, ValueError):
            raise UserError(
                f"method '{name}': parameter {key}={value!r} is a {type(value).__name__}; only numbers, text, "
                "true/false, None and lists of them reach a worker"
            ) from None
    return values
