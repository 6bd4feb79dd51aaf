"""A pair before and after, each source point coloured by its distance to the target."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from regbench.geometry.se3 import transform
from regbench.report.picture import Colour, Up, render_pair

if TYPE_CHECKING:
    from PIL.Image import Image

Array = NDArray[np.float64]

TARGET_GREY: Colour = (176, 176, 176)
# From dark to light, so that it is read in grey too: near, ..., far.
RAMP = np.array([[20, 30, 110], [0, 104, 178], [120, 100, 160], [214, 96, 60], [240, 160, 30]], dtype=np.float64)
# The colour of the farthest is reached at this share of the target's diagonal.
FULL_SHARE = 0.05
BAR_HEIGHT = 46


def distance_picture(
    source: ArrayLike, target: ArrayLike, T_target_source: ArrayLike, words: str, *, up: Up = "y"
) -> Image:
    """Return a picture of 1200 x 646 pixels: before on the left, after on the right, words and the colours' key below.

    The target is grey; a source point's colour says how far its nearest target point is.

    Args:
        source: (N, 3) points.
        target: (M, 3) points.
        T_target_source: (4, 4) answer.
        words: What is shown, one line.
        up: The clouds' axis that points upwards.
    """
    before, fixed = np.asarray(source, dtype=np.float64), np.asarray(target, dtype=np.float64)
    after = transform(T_target_source, before)
    full = FULL_SHARE * float(np.linalg.norm(np.ptp(fixed, axis=0))) or 1.0
    panels: list[list[tuple[Array, Colour | Array]]] = [
        [(fixed, TARGET_GREY), (moved, colours(nearest_distances(moved, fixed) / full))] for moved in (before, after)
    ]
    return _with_key(render_pair(panels[0], panels[1], up=up), words, full)


def nearest_distances(points: Array, others: Array) -> Array:
    """Return the distance of each of (N, 3) points to the nearest of (M, 3) others, (N,)."""
    from scipy.spatial import cKDTree

    distances, _ = cKDTree(others).query(points)
    return np.asarray(distances, dtype=np.float64)


def colours(shares: Array) -> Array:
    """Return the ramp's colour of (N,) shares of the full distance, (N, 3) of 0..255; beyond 1 as 1."""
    places = np.linspace(0, 1, len(RAMP))
    return np.column_stack([np.interp(shares, places, RAMP[:, channel]) for channel in range(3)])


def _with_key(image: Image, words: str, full: float) -> Image:
    """Return the picture with a line of words and a bar of the colours below it."""
    from PIL import Image as Images
    from PIL import ImageDraw, ImageFont

    width, height = image.size
    taller = Images.new("RGB", (width, height + BAR_HEIGHT), "white")
    taller.paste(image, (0, 0))
    left, right, top = width - 380, width - 160, height + 14
    bar = colours(np.linspace(0, 1, right - left)).round().astype(np.uint8)
    taller.paste(Images.fromarray(np.repeat(bar[None], 14, axis=0)), (left, top))
    draw, font, grey = ImageDraw.Draw(taller), ImageFont.load_default(size=17), (70, 70, 70)
    draw.text((20, top - 3), _fitting(words, font.getlength, left - 60), fill=grey, font=font)
    draw.text((left - 16, top - 3), "0", fill=grey, font=font)
    draw.text((right + 6, top - 3), f"{full:.2g} or more", fill=grey, font=font)
    return taller


def _fitting(words: str, length: object, width: float) -> str:
    """Return the words, cut where they are longer than `width` pixels; what the font lacks is a question mark."""
    assert callable(length)
    plain = "".join(letter if letter.isprintable() and ord(letter) < 0x250 else "?" for letter in words)
    while length(plain) > width:
        plain = plain.removesuffix("...")[:-1] + "..."
    return plain
