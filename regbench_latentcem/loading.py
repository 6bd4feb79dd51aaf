"""Makes the models ready: learned weights from the package, or the untrained equivariant model."""

from __future__ import annotations

from typing import Literal

from regbench.errors import UserError
from regbench.learning.weights import load_weights

from .equivariant import VectorEncoder
from .matching import Matcher
from .model import Configuration, EquivariantModel, LatentModel
from .weight_files import matcher_path, named, weight_files


def load_model(model: Literal["paper", "equivariant"], weights: str) -> LatentModel | EquivariantModel:
    """Return a model with weights of this package.

    Args:
        model: Which one.
        weights: Their name; "default"; or "none": random ones, for "equivariant".

    Raises:
        UserError: There are no such weights, or they are damaged or of another model.
    """
    name = named(model, weights)
    if model == "paper":
        return load_paper_model(name)
    return untrained_equivariant_model() if name == "none" else load_equivariant_model(name)


def load_paper_model(name: str) -> LatentModel:
    """Return the paper's networks with weights of this package, or of a path; see `WeightFiles`.

    Raises:
        UserError: There are no such weights, or they are damaged or of another model.
    """
    path = weight_files().path(name)
    weights = load_weights(path)
    try:
        configuration = Configuration.from_card(weights.card["configuration"])
    except (KeyError, TypeError, ValueError) as error:
        raise UserError(f"weights {path}: the model card's 'configuration' is not LatentCEM's: {error}") from None
    model = LatentModel(configuration)
    weights.load_into(model.without_decoder())
    return model


def load_equivariant_model(name: str) -> EquivariantModel:
    """Return the equivariant model with weights of this package, or of a path; see `WeightFiles`.

    Raises:
        UserError: There are no such weights, or they are damaged or of another model.
    """
    weights = load_weights(weight_files().path(name))
    model = untrained_equivariant_model()
    weights.load_into(model.encoder)
    return model


def load_matcher() -> Matcher:
    """Return the fitted matcher of this package.

    Raises:
        UserError: Its weights are missing or damaged.
    """
    matcher = Matcher()
    load_weights(matcher_path()).load_into(matcher)
    return matcher


def untrained_equivariant_model() -> EquivariantModel:
    """Return the equivariant model with random features of a fixed seed, and the latent distance as d."""
    return EquivariantModel(VectorEncoder())
