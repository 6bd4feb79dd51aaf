"""7-Scenes from depth frames: SOURCE/<scene>/seq-XX/frame-XXXXXX.{depth.png,pose.txt}."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from regbench.datasets.dataset import Split
from regbench.datasets.readers.png import read_depth_png
from regbench.datasets.readers.transform import read_transform
from regbench.datasets.store_writer import write_dataset
from regbench.errors import UserError
from regbench.geometry.se3 import nearest_rigid

from .depth import project_pixels, valid_pixels
from .outcome import reason, say_outcome
from .seeds import item_generator

NAME = "7scenes"
# The published poses are orthonormal to about 4e-4; beyond this a pose is odd enough to be named.
POSE_TOLERANCE = 1e-2


@dataclass(frozen=True, eq=False)
class _Frame:
    id: str
    points: NDArray[np.float32]
    pose: NDArray[np.float64]
    pose_error: float


def prepare(source: Path, data_dir: Path, *, points: int = 4096, seed: int = 0, report: Callable[[str], None]) -> Path:
    """Prepare 7-Scenes: `points` points of every frame in metres and the camera's frame, and the camera's pose.

    Points are drawn uniformly without replacement from the frame's valid pixels and stay in random order. Poses are
    made exact rotations (the nearest, by SVD). Frames that cannot be used are left out and named.

    Args:
        source: Folder of scenes.
        data_dir: Folder of prepared datasets.
        points: Points a frame.
        seed: Seed of the draw.
        report: Called with one line on what was done, or is odd.

    Returns:
        The prepared dataset's folder.

    Raises:
        UserError: There are no frames, or none can be used, or the dataset cannot be written.
    """
    frames = _find_frames(source)
    if not frames:
        raise UserError(f"{source}: no frames found; expected <scene>/seq-XX/frame-XXXXXX.depth.png")
    scene_names = sorted({scene for scene, _ in frames})
    # One array from the start: untouched rows at its end cost nothing, a list and its stack would cost double.
    clouds = np.empty((len(frames), points, 3), dtype=np.float32)
    poses: list[NDArray[np.float64]] = []
    labels: list[int] = []
    ids: list[str] = []
    left_out: dict[str, str] = {}
    remarks: dict[str, str] = {}
    # Decoding PNGs is the cost, and Pillow does it without the interpreter's lock.
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        read = pool.map(lambda item: _read_frame(item[0], item[1], points, seed), frames)
        for (scene, path), frame in zip(frames, read, strict=True):
            if isinstance(frame, str):
                left_out[_frame_id(scene, path)] = frame
                continue
            clouds[len(ids)] = frame.points
            poses.append(frame.pose)
            labels.append(scene_names.index(scene))
            ids.append(frame.id)
            if frame.pose_error > POSE_TOLERANCE:
                remarks[frame.id] = f"its pose was off a rotation by {frame.pose_error:.2g}"
    if not ids:
        first = next(iter(left_out))
        raise UserError(f"{source}: none of {len(frames)} frames can be used ({first}: {left_out[first]})")
    changed = write_dataset(
        data_dir,
        NAME,
        description=f"7-Scenes (Microsoft Research), depth frames of {', '.join(scene_names)}",
        label_names=scene_names,
        splits={"scans": Split(clouds[: len(ids)], np.array(labels, dtype=np.int64), ids, np.stack(poses))},
        options={"points": points, "seed": seed},
        left_out=left_out,
        remarks=remarks,
    )
    say_outcome(report, NAME, f"{len(ids)} scans of {points} points", left_out, remarks, changed=changed)
    return data_dir / NAME


def _find_frames(source: Path) -> list[tuple[str, Path]]:
    """Return each frame's scene and depth image, sorted: of one scene's folder, of scenes, or of unpacked archives."""
    if not source.is_dir():
        raise UserError(f"{source}: no such folder")
    source = source.resolve()  # a scene is named after its folder, also for "."
    sequences = [path for depth in ("", "*/", "*/*/") for path in source.glob(f"{depth}seq-*") if path.is_dir()]
    return sorted((path.parent.name, image) for path in sequences for image in path.glob("*.depth.png"))


def _frame_id(scene: str, path: Path) -> str:
    return f"{scene}/{path.parent.name}/{path.name.removesuffix('.depth.png')}"


def _read_frame(scene: str, path: Path, points: int, seed: int) -> _Frame | str:
    """Return a frame, or why it cannot be used."""
    frame_id = _frame_id(scene, path)
    pose_path = path.with_name(path.name.replace(".depth.png", ".pose.txt"))
    try:
        depth = read_depth_png(path)
        given = read_transform(pose_path)
    except UserError as error:
        return reason(error, path.parent)
    pose = nearest_rigid(given)
    pose_error = float(np.abs(pose[:3, :3] - given[:3, :3]).max())
    valid = valid_pixels(depth)
    if len(valid) < points:
        return f"only {len(valid)} valid pixels, {points} wanted"
    drawn = item_generator(seed, frame_id).choice(valid, points, replace=False)
    return _Frame(frame_id, project_pixels(depth, drawn), pose, pose_error)
