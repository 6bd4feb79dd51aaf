"""Checks of what a method's class says of itself; nothing is registered."""

from __future__ import annotations

import importlib.util
import json
import re
from typing import Any

from regbench.errors import UserError
from regbench.parameters import defaults_of, parameter_types
from regbench.testing.check_result import CheckFailed
from regbench.testing.subject import Subject

KINDS = ("classical", "learned", "sentinel")


def check_interface(subject: Subject) -> str:
    """`name` is a name that `--method` can read; `register` is there; optional attributes have their types."""
    name = getattr(subject.method_class, "name", None)
    if not isinstance(name, str) or not re.fullmatch(r"[A-Za-z0-9_.\-]+", name):
        raise CheckFailed(f"the class needs a `name` of letters, digits and _ . -, got {name!r}")
    if not callable(getattr(subject.method_class, "register", None)):
        raise CheckFailed("the class needs a method `register(self, problem)`")
    if (kind := subject.trait("kind")) not in KINDS:
        raise CheckFailed(f"`kind` is one of {', '.join(KINDS)}, got {kind!r}")
    for attribute, expected in (("version", str), ("deterministic", bool), ("sees_ground_truth", bool)):
        if not isinstance(value := subject.trait(attribute), expected):
            raise CheckFailed(f"`{attribute}` is a {expected.__name__}, got {value!r}")
    return f"name '{name}', register(problem)"


def check_constructor(subject: Subject) -> str:
    """Arguments are keyword-only with defaults, stored unchanged under their names, and nothing else is stored."""
    try:
        names = list(parameter_types(subject.method_class))
    except UserError as error:
        raise CheckFailed(str(error)) from None
    expected = defaults_of(subject.method_class) | dict(subject.parameters)
    instance = subject.method_class(**subject.parameters)
    for name, value in expected.items():
        if not hasattr(instance, name):
            raise CheckFailed(f"parameter '{name}' is not stored; write self.{name} = {name}")
        if getattr(instance, name) is not value and getattr(instance, name) != value:
            raise CheckFailed(f"parameter '{name}' is stored changed: {value!r} became {getattr(instance, name)!r}")
    if more := sorted(set(getattr(instance, "__dict__", {})) - set(names)):
        raise CheckFailed(f"__init__ stores more than its parameters: {', '.join(more)}; do that in prepare()")
    return f"parameters: {', '.join(names)}" if names else "no parameters"


def check_parameters(subject: Subject) -> str:
    """Defaults and given parameters are of their declared types and survive JSON; `repr` is a line of text."""
    values = defaults_of(subject.method_class) | dict(subject.parameters)
    _require_types(subject.method_class, values, "parameter")
    for name, value in values.items():
        try:
            json.dumps(value, allow_nan=False)
        except (TypeError, ValueError) as error:
            raise CheckFailed(f"parameter '{name}' cannot be written as JSON: {error}") from None
    text = repr(subject.method_class(**subject.parameters))
    if not isinstance(text, str) or "\n" in text:
        raise CheckFailed("repr of the method is not one line of text")
    return text


def check_presets(subject: Subject) -> str:
    """Presets set parameters that exist, to values of their types."""
    presets = subject.trait("presets")
    for preset, values in presets.items():
        if preset == "default":
            raise CheckFailed("the preset name 'default' is taken: it means the constructor's defaults")
        if unknown := sorted(set(values) - set(parameter_types(subject.method_class))):
            raise CheckFailed(f"preset '{preset}' sets parameters that do not exist: {', '.join(unknown)}")
        _require_types(subject.method_class, values, f"preset '{preset}'")
    return f"presets: {', '.join(presets)}" if presets else "no presets"


def check_requires(subject: Subject) -> str:
    """The modules that the method needs can be found."""
    requires = subject.trait("requires")
    if isinstance(requires, str):
        raise CheckFailed(f"`requires` is a sequence of module names; write ({requires!r},)")
    if missing := [module for module in requires if importlib.util.find_spec(module) is None]:
        raise CheckFailed(f"not installed: {', '.join(missing)}")
    return f"found: {', '.join(requires)}" if requires else "needs nothing more"


def _require_types(method_class: type, values: Any, where: str) -> None:
    from pydantic import ConfigDict, TypeAdapter, ValidationError

    annotations = parameter_types(method_class)
    for name, value in values.items():
        adapter = TypeAdapter(annotations[name], config=ConfigDict(arbitrary_types_allowed=True))
        try:
            adapter.validate_python(value, strict=True)
        except ValidationError as error:
            raise CheckFailed(f"{where}: {name}={value!r}: {error.errors()[0]['msg']}") from None
