"""A generator for each item, from the preparation's seed and the item's id: the order of items does not matter."""

from __future__ import annotations

import hashlib

import numpy as np


def item_generator(seed: int, item_id: str) -> np.random.Generator:
    """Return a PCG64 generator that depends on the seed and the id alone."""
    digest = hashlib.sha256(f"{seed}|{item_id}".encode()).digest()
    return np.random.Generator(np.random.PCG64(int.from_bytes(digest[:8], "little")))
