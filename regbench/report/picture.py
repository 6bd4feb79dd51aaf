"""Pictures of clouds, drawn in numpy: no display, no OpenGL.

Each point is a small shaded ball. A z-buffer keeps the nearest surface at each pixel; the picture is drawn larger
than asked for and reduced, which smooths the edges.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from regbench.errors import UserError
from regbench.geometry.se3 import rotation_from_euler_deg, transform

if TYPE_CHECKING:
    from PIL.Image import Image

Array = NDArray[np.float64]
Colour = tuple[int, int, int]
Clouds = Sequence[tuple[Array, Colour | Array]]
Up = Literal["y", "z"]

# Blue and orange of Okabe and Ito's palette: told apart with every common kind of colour blindness, and in grey.
SOURCE_COLOUR: Colour = (230, 130, 0)
TARGET_COLOUR: Colour = (0, 104, 178)
WHITE = 255.0
MARGIN = 0.06
OUTSIDE_PERCENT = 0.2
SMOOTHING = 2
# Light from the upper left, in front.
LIGHT = np.array([-0.4, 0.5, 0.77]) / np.linalg.norm([-0.4, 0.5, 0.77])
# From the clouds' frame to one whose y points upwards.
UPRIGHT = {"y": np.eye(3), "z": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])}
# How much of its colour the farthest point loses to the white ground.
FADE = 0.55


def save_before_after(
    path: Path, source: ArrayLike, target: ArrayLike, T_target_source: ArrayLike, *, up: Up = "z"
) -> None:
    """Save a PNG of 1200 x 600 pixels: source and target as given on the left, the source moved on the right.

    The source is orange, the target blue.

    Args:
        path: Where to; its ending must be .png.
        source: (N, 3) points.
        target: (M, 3) points.
        T_target_source: (4, 4) motion.
        up: The clouds' axis that points upwards.

    Raises:
        UserError: The ending is another, or the file cannot be written.
    """
    if path.suffix.lower() != ".png":
        raise UserError(f"{path}: a picture is saved as PNG; let its name end in .png")
    fixed = (np.asarray(target, dtype=np.float64), TARGET_COLOUR)
    before = (np.asarray(source, dtype=np.float64), SOURCE_COLOUR)
    after = (transform(T_target_source, before[0]), SOURCE_COLOUR)
    image = render_pair([fixed, before], [fixed, after], up=up)
    try:
        image.save(path, format="PNG", optimize=True)
    except OSError as error:
        path.unlink(missing_ok=True)
        raise UserError(f"{path}: cannot be written ({error.strerror})") from error


def render_pair(before: Clouds, after: Clouds, *, up: Up = "z", size: tuple[int, int] = (1200, 600)) -> Image:
    """Return two panels side by side, seen from one direction at one scale, each centred on what it shows.

    Args:
        before: (points (N, 3), colour (red, green, blue) of 0..255, of all or (N, 3)) of each cloud on the left.
        after: Likewise on the right.
        up: The clouds' axis that points upwards.
        size: Width and height in pixels.

    Raises:
        ValueError: A panel has no point, or a value is not finite.
    """
    from PIL import Image

    panels = [np.concatenate([np.empty((0, 3)), *(points for points, _ in clouds)]) for clouds in (before, after)]
    if not all(len(points) and np.isfinite(points).all() for points in panels):
        raise ValueError("a picture needs at least one point in each panel, and finite values alone")
    view = best_view(panels[1], up)
    seen = [points @ view.T for points in panels]
    width, height = size[0] // 2, size[1]
    scale = min(_scale(points, width, height) for points in seen)
    radius = ball_radius(max(map(len, panels)), height)
    images = [
        _panel((height * SMOOTHING, width * SMOOTHING), points, colours, scale * SMOOTHING, radius * SMOOTHING)
        for points, colours in zip(seen, map(_colours, (before, after)), strict=True)
    ]
    image = Image.fromarray(np.concatenate(images, axis=1).round().astype(np.uint8))
    image = image.resize((2 * width, height), Image.Resampling.BOX)
    _label(image, width, height)
    return image


def _label(image: Image, width: int, height: int) -> None:
    """Write what each panel is into its corner, and draw the line between them."""
    from PIL import ImageDraw, ImageFont

    draw, grey = ImageDraw.Draw(image), (110, 110, 110)
    for panel, words in enumerate(("before", "after")):
        font = ImageFont.load_default(size=height / 30)
        draw.text((panel * width + height / 30, height / 40), words, fill=grey, font=font)
    draw.line([(width, height / 12), (width, height - height / 12)], fill=(215, 215, 215))


def best_view(points: Array, up: Up) -> Array:
    """Return the (3, 3) rotation into the viewer's frame: x right, y up, z towards the eye.

    A three-quarter view from 25 deg above; of eight directions the one in which (N, 3) points spread least in depth,
    so that most of them is seen.
    """
    upright = UPRIGHT[up]
    views = [
        rotation_from_euler_deg([25, 0, 0]) @ rotation_from_euler_deg([0, yaw, 0]) @ upright
        for yaw in (-35, 35, -55, 55, 145, -145, 125, -125)
    ]
    return min(views, key=lambda view: round(float((points @ view[2]).var()), 9))


def ball_radius(points: int, height: int) -> float:
    """Return the radius in pixels at which so many balls cover a panel about evenly, between 1 and 6 at 600."""
    return height / 600 * float(np.clip(170 / np.sqrt(max(points, 1)), 1.0, 6.0))


def _scale(seen: Array, width: int, height: int) -> float:
    """Return the pixels per length at which (N, 3) points fill a panel."""
    low, high = _box(seen)
    room = np.array([width, height]) * (1 - 2 * MARGIN)
    return float((room / np.maximum(high - low, 1e-12)[:2]).min())


def _box(seen: Array) -> tuple[Array, Array]:
    """Return the corners of what a panel is to show, (3,) each: of a laser scan, not the few farthest points."""
    low, high = np.percentile(seen, [OUTSIDE_PERCENT, 100 - OUTSIDE_PERCENT], axis=0)
    return low, high


def _colours(clouds: Clouds) -> Array:
    """Return the colour of every point of some clouds, (N, 3)."""
    return np.concatenate(
        [np.broadcast_to(np.asarray(colour, dtype=np.float64), (len(points), 3)) for points, colour in clouds]
    )


def _panel(shape: tuple[int, int], seen: Array, colours: Array, scale: float, radius: float) -> Array:
    """Return (N, 3) points of the viewer's frame drawn as balls on white, (height, width, 3) float64 of 0..255."""
    height, width = shape
    low, high = _box(seen)
    centre = (low + high) / 2
    x = width / 2 + (seen[:, 0] - centre[0]) * scale
    y = height / 2 - (seen[:, 1] - centre[1]) * scale
    offsets, normals = _ball(radius)
    columns = np.rint(x[:, None]).astype(np.intp) + offsets[:, 0]
    rows = np.rint(y[:, None]).astype(np.intp) + offsets[:, 1]
    # Points that coincide are moved apart in depth by less than a ball, so that both colours show there.
    apart = np.random.Generator(np.random.PCG64(0)).uniform(0, radius, len(seen))
    depth = (seen[:, 2] * scale + apart)[:, None] + radius * normals[:, 2]
    inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
    point, pixel_of_ball = np.nonzero(inside)
    pixel = rows[inside] * width + columns[inside]

    # z-buffer: of all that falls on a pixel, the nearest to the eye stays.
    order = np.argsort(depth[inside], kind="stable")
    nearest = np.full(height * width, -1, dtype=np.intp)
    nearest[pixel[order]] = order
    hit = np.flatnonzero(nearest >= 0)
    winner = nearest[hit]

    nearness = np.clip((seen[:, 2] - low[2]) / max(high[2] - low[2], 1e-12), 0, 1)
    fade = (FADE * (1 - nearness))[point[winner], None]
    light = (0.62 + 0.38 * np.clip(normals @ LIGHT, 0, 1))[pixel_of_ball[winner], None]
    shaded = colours[point[winner]] * light
    canvas = np.full((height * width, 3), WHITE)
    canvas[hit] = shaded * (1 - fade) + WHITE * fade
    return canvas.reshape(height, width, 3)


def _ball(radius: float) -> tuple[NDArray[np.intp], Array]:
    """Return the pixels of a ball's disc, (k, 2) offsets right and down, and its normals there, (k, 3)."""
    reach = np.arange(-int(radius), int(radius) + 1)
    offsets = np.stack(np.meshgrid(reach, reach), axis=-1).reshape(-1, 2)
    squared = (offsets**2).sum(axis=1)
    offsets, squared = offsets[squared <= radius**2], squared[squared <= radius**2]
    towards = np.sqrt(radius**2 - squared)
    normals = np.column_stack([offsets[:, 0], -offsets[:, 1], towards]) / radius
    return offsets.astype(np.intp), normals
