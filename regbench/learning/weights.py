"""The weight store: tensors in a safetensors file, beside it a model card (JSON) that holds its SHA-256.

Nothing is unpickled: safetensors is a table of names, types and shapes, and raw numbers.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from torch import Tensor, nn

from regbench.errors import UserError
from regbench.files import write_atomically
from regbench.learning.weight_files import SUFFIX


@dataclass(frozen=True)
class Weights:
    """A model's tensors and its card.

    Attributes:
        path: The safetensors file.
        tensors: By name, on the CPU.
        card: What is known of them: data, configuration, figures; and "sha256" of the file.
    """

    path: Path
    tensors: Mapping[str, Tensor]
    card: Mapping[str, Any]

    def load_into(self, network: nn.Module) -> None:
        """Copy the tensors into a network.

        Raises:
            UserError: Names or shapes are not those of the network: the file belongs to another model.
        """
        expected = {name: tuple(tensor.shape) for name, tensor in network.state_dict().items()}
        found = {name: tuple(tensor.shape) for name, tensor in self.tensors.items()}
        wrong = sorted(name for name in expected.keys() | found.keys() if expected.get(name) != found.get(name))
        if wrong:
            name = wrong[0]
            raise UserError(
                f"weights {self.path}: made for another model: tensor '{name}' is {_shape(found.get(name))}, "
                f"{type(network).__name__} needs {_shape(expected.get(name))} ({len(wrong)} such tensors); "
                "use the configuration of the model card, or other weights"
            )
        network.load_state_dict(dict(self.tensors))


def card_path(path: Path) -> Path:
    """Return where the card of a weight file lies: NAME.json beside NAME.safetensors."""
    return path.with_suffix(".json")


def save_weights(path: Path, tensors: Mapping[str, Tensor], card: Mapping[str, Any]) -> None:
    """Write tensors and their card; an older pair of files is replaced, never half overwritten.

    Args:
        path: File to write, ending in .safetensors; its folder must exist.
        tensors: By name, e.g. a network's state_dict().
        card: Whatever JSON can hold; "sha256" is added.

    Raises:
        UserError: The path does not end in .safetensors, the card cannot be written as JSON, or a file not at all.
    """
    from safetensors.torch import save

    if path.suffix != SUFFIX:
        raise UserError(f"weights {path}: the name must end in {SUFFIX}")
    data = save({name: tensor.detach().cpu().contiguous() for name, tensor in tensors.items()})
    try:
        text = json.dumps({**card, "sha256": hashlib.sha256(data).hexdigest()}, indent=2) + "\n"
    except (TypeError, ValueError) as error:
        raise UserError(f"weights {path}: the card cannot be written as JSON: {error}") from None
    write_atomically(path, data)
    write_atomically(card_path(path), text.encode())


def load_weights(path: Path) -> Weights:
    """Read a weight file and its card, and check the one against the other.

    Raises:
        UserError: A file is missing or unreadable, the SHA-256 is not the card's (a truncated or changed file), or
            it is no safetensors file.
    """
    from safetensors import SafetensorError
    from safetensors.torch import load

    data, card = _read(path), _read_card(card_path(path))
    if hashlib.sha256(data).hexdigest() != card.get("sha256"):
        raise UserError(
            f"weights {path}: its SHA-256 is not the one in {card_path(path).name}: the file is truncated or changed "
            f"({len(data)} bytes); fetch it again, or train anew"
        )
    try:
        return Weights(path, load(data), card)
    except (SafetensorError, ValueError, KeyError) as error:
        raise UserError(f"weights {path}: not a safetensors file: {error}") from None


def add_test_figures(
    path: Path, figures: Mapping[str, Mapping[str, Mapping[str, Mapping[str, Any]]]]
) -> tuple[list[str], list[str]]:
    """Write test figures into a weight file's card: "test", by method, protocol and device; others stay as they are.

    Args:
        path: The weight file.
        figures: By method, protocol and device; "n" among them.

    Returns:
        In words, what was written, and what was not: figures of fewer trials than those that are there.

    Raises:
        UserError: The card cannot be read or written, or its "test" is not such a table.
    """
    card = _read_card(card_path(path))
    test = card.get("test", {})
    written, left_out = [], []
    rows = [
        (method, protocol, device, new)
        for method, by_protocol in figures.items()
        for protocol, by_device in by_protocol.items()
        for device, new in by_device.items()
    ]
    for method, protocol, device, new in rows:
        what = f"{method} on {protocol}, {device}"
        try:
            there = test.setdefault(method, {}).setdefault(protocol, {})
            before = there.get(device, {}).get("n", 0)
            if before > new["n"]:
                left_out.append(f"{what}: the card has figures of {before} trials, these are of {new['n']}")
                continue
        except (AttributeError, TypeError):
            where = card_path(path)
            raise UserError(
                f"model card {where}: its 'test' is no table by method, protocol and device; delete it"
            ) from None
        there[device] = dict(new)
        written.append(what)
    write_atomically(card_path(path), (json.dumps({**card, "test": test}, indent=2) + "\n").encode())
    return written, left_out


def _read_card(path: Path) -> dict[str, Any]:
    try:
        card = json.loads(_read(path))
    except ValueError as error:  # also where the bytes are no text
        raise UserError(f"model card {path}: not JSON: {error}") from None
    if not isinstance(card, dict):
        raise UserError(f"model card {path}: not a JSON object")
    return card


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise UserError(f"weights: cannot read {path}: {error.strerror}") from None


def _shape(shape: tuple[int, ...] | None) -> str:
    return "absent" if shape is None else str(list(shape))
