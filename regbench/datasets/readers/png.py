"""16-bit depth images."""

from __future__ import annotations

import struct
import warnings
import zlib
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from regbench.datasets.readers.checks import naming, read_bytes
from regbench.errors import UserError

MAX_SIDE = 16384


def read_depth_png(path: Path) -> NDArray[np.uint16]:
    """Return a 16-bit greyscale PNG as (H, W) uint16, in the file's own unit.

    Raises:
        UserError: The file cannot be read, is not a PNG, or is not 16-bit greyscale.
    """
    from PIL import Image

    content = read_bytes(path)
    if not content.startswith(b"\x89PNG\r\n\x1a\n"):
        raise UserError(f"{path}: not a PNG image")
    # Pillow reports a broken PNG by any of these, depending on where it breaks.
    errors = (OSError, SyntaxError, ValueError, EOFError, struct.error, zlib.error)
    bombs = (Image.DecompressionBombError, Image.DecompressionBombWarning)
    with naming(path, "PNG image", *errors, *bombs), warnings.catch_warnings():
        warnings.simplefilter("error", Image.DecompressionBombWarning)
        with Image.open(BytesIO(content), formats=["PNG"]) as image:
            if not image.mode.startswith("I"):
                raise UserError(f"{path}: not a 16-bit greyscale image (mode {image.mode})")
            if max(image.size) > MAX_SIDE:
                raise UserError(f"{path}: {image.size[0]} x {image.size[1]} pixels are not a depth image")
            depth = np.asarray(image)
    return np.ascontiguousarray(depth, dtype=np.uint16)
