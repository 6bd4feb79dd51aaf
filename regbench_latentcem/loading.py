"""Makes the models ready: learned weights from the package, or the untrained equivariant model."""

from __future__ import annotations

from pathlib import Path

from regbench.errors import UserError
from regbench.learning.weights import load_weights

from .equivariant import VectorEncoder
from .model import Configuration, EquivariantModel, LatentModel

FOLDER = Path(__file__).parent / "weights"


def load_paper_model(name: str) -> LatentModel:
    """Return the paper's networks with the weights NAME.safetensors of this package.

    Raises:
        UserError: There are no such weights, or they are damaged or of another model.
    """
    path = FOLDER / f"{name}.safetensors"
    if not path.is_file():
        there = ", ".join(sorted(file.stem for file in FOLDER.glob("*.safetensors"))) or "none yet"
        raise UserError(
            f"latentcem: no weights '{name}' in {FOLDER} (there: {there}): the paper's model is not trained yet; "
            "use latentcem[model=equivariant], which needs none"
        )
    weights = load_weights(path)
    try:
        configuration = Configuration(**weights.card["configuration"])
    except (KeyError, TypeError) as error:
        raise UserError(f"weights {path}: the model card's 'configuration' is not LatentCEM's: {error}") from None
    model = LatentModel(configuration)
    weights.load_into(model)
    return model


def untrained_equivariant_model() -> EquivariantModel:
    """Return the equivariant model with random features of a fixed seed, and the latent distance as d."""
    return EquivariantModel(VectorEncoder())
