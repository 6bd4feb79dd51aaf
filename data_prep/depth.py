"""Depth frames to clouds in the camera's frame, and the draw of points from a frame."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# The depth camera of 7-Scenes (Shotton et al. 2013): focal length and principal point in pixels.
FOCAL_LENGTH = 585.0
PRINCIPAL_POINT = (320.0, 240.0)
# Both mean that the sensor saw nothing.
INVALID_DEPTHS = (0, 65535)


def valid_pixels(depth: NDArray[np.uint16]) -> NDArray[np.intp]:
    """Return the flat indices of the pixels of an (H, W) depth image that hold a depth."""
    # 0 and 65535 are the two ends: adding 1 wraps 65535 to 0, so one comparison tells both.
    return np.flatnonzero(depth + np.uint16(1) > 1)


def project_pixels(
    depth: NDArray[np.uint16], pixels: NDArray[np.intp], *, unit_m: float = 0.001
) -> NDArray[np.float32]:
    """Return points of some pixels in metres: x right, y down, z forward; (N, 3) float32.

    X = (u - cx) z / f, Y = (v - cy) z / f, Z = z.

    Args:
        depth: (H, W) depths.
        pixels: (N,) flat indices into the image.
        unit_m: Metres of one unit of depth; 7-Scenes stores millimetres.
    """
    width = depth.shape[1]
    v, u = np.divmod(pixels.astype(np.uint32), np.uint32(width))  # 32 bits: divides several times faster than 64
    z = depth.ravel()[pixels] * np.float32(unit_m)
    ray = z * np.float32(1 / FOCAL_LENGTH)
    points = np.empty((len(pixels), 3), dtype=np.float32)
    np.multiply(u.astype(np.float32) - np.float32(PRINCIPAL_POINT[0]), ray, out=points[:, 0])
    np.multiply(v.astype(np.float32) - np.float32(PRINCIPAL_POINT[1]), ray, out=points[:, 1])
    points[:, 2] = z
    return points


def project_depth(depth: NDArray[np.uint16], *, unit_m: float = 0.001) -> NDArray[np.float32]:
    """Return the cloud of a whole depth image, in the order of its valid pixels; (N, 3) float32 in metres."""
    return project_pixels(depth, valid_pixels(depth), unit_m=unit_m)
