"""Weights from an original implementation's checkpoint: read without unpickling code, renamed, checked, stored."""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from regbench.errors import UserError
from regbench.learning.weight_files import SUFFIX
from regbench.learning.weights import save_weights

# Where checkpoints keep their state_dict, besides being one.
WRAPPINGS = ("state_dict", "model_state_dict", "model", "net")
# What torch.nn.DataParallel puts before every name.
PARALLEL = "module."


def read_state(path: Path) -> dict[str, Tensor]:
    """Return the state_dict of a checkpoint file.

    Raises:
        UserError: The file cannot be read without running code from it, or holds no tensors by name.
    """
    try:
        content = torch.load(path, map_location="cpu", weights_only=True)
    except OSError as error:
        raise UserError(f"checkpoint {path}: cannot be read ({error.strerror})") from None
    except Exception as error:  # noqa: BLE001 - torch raises many kinds for what is no checkpoint, or needs code to be read
        reason = " ".join(str(error).split())[:120]
        raise UserError(
            f"checkpoint {path}: torch cannot read it as plain tensors ({type(error).__name__}: {reason}); nothing "
            "else is unpickled. Save its state_dict alone with torch.save"
        ) from None
    for key in WRAPPINGS:
        if isinstance(content, Mapping) and isinstance(content.get(key), Mapping):
            content = content[key]
    tensors = {}
    if isinstance(content, Mapping):
        tensors = {str(name).removeprefix(PARALLEL): value for name, value in content.items()}
    if not tensors or not all(isinstance(value, Tensor) for value in tensors.values()):
        raise UserError(f"checkpoint {path}: no state_dict: tensors by name are needed, alone or under {WRAPPINGS}")
    return tensors


def import_checkpoint(
    path: Path,
    out: Path,
    *,
    method: str,
    renamed: Callable[[Mapping[str, Tensor]], tuple[dict[str, Tensor], dict[str, Any]]],
    check: Callable[[Path], None],
) -> None:
    """Store a checkpoint's weights as safetensors with a card that names the source.

    Args:
        path: The checkpoint.
        out: File to write, ending in .safetensors.
        method: Whose weights they are.
        renamed: Returns our tensors by name and the network's configuration, of the checkpoint's tensors.
        check: Raises if weights at a path are not the method's.

    Raises:
        UserError: The checkpoint cannot be read or is of another network, or `out` cannot be written.
    """
    if out.suffix != SUFFIX:
        raise UserError(f"{out}: the name must end in {SUFFIX}")
    if out.exists():
        raise UserError(f"{out} exists; give another --out, or delete it")
    state = read_state(path)
    try:
        tensors, configuration = renamed(state)
    except (KeyError, ValueError) as error:
        what = f"it has no '{error.args[0]}'" if isinstance(error, KeyError) else str(error)
        raise UserError(
            f"checkpoint {path}: not of a network that {method} knows: {what} (it begins with '{next(iter(state))}')"
        ) from None
    card = {
        "method": method,
        "configuration": configuration,
        "source": {"file": path.name, "sha256": hashlib.sha256(path.read_bytes()).hexdigest()},
        "supervision": "imported",
    }
    with tempfile.TemporaryDirectory() as folder:
        trial = Path(folder, out.name)
        save_weights(trial, tensors, card)
        check(trial)
    out.parent.mkdir(parents=True, exist_ok=True)
    save_weights(out, tensors, card)
