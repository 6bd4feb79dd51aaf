"""The protocols on 7-Scenes' depth frames, and the rule that says which frames are for testing."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from regbench.datasets.dataset import Dataset, Split
from regbench.errors import UserError
from regbench.geometry.se3 import invert, se3
from regbench.protocols.draws import generator
from regbench.protocols.moved_copy import Cloud, MovedCopies, copied
from regbench.protocols.protocol import Pair, ProblemSet, Protocol
from regbench.registry import open_dataset

TRAIN_SCANS, TEST_SCANS = 296, 57
UNSEEN_SCENE_SCANS = 12
POINTS = 784
FRAME_GAP = 20


def split_scans(ids: Sequence[str]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the indices of the 296 training and 57 test scans, by this rule.

    Scans are sorted by id (`scene/sequence/frame`), and 'k of' means evenly spaced over a sorted list.

    * Where office is in the data (the rule of FMR and CEMNet): test on 57 of office, train on 296 of all others.
    * Else, the stand-in: test on 12 of stairs, a scene that training never sees, and 45 of the last fifth of
      redkitchen; train on 296 of the first three quarters of redkitchen. The frames between are left out, so that no
      test frame has a near twin in training.

    Raises:
        UserError: Too few scans for either rule.
    """
    by_scene: dict[str, list[int]] = {}
    for index in sorted(range(len(ids)), key=lambda index: ids[index]):
        by_scene.setdefault(ids[index].split("/")[0], []).append(index)
    if "office" in by_scene:
        test = _evenly(by_scene.pop("office"), TEST_SCANS, "office")
        train = _evenly([index for scans in by_scene.values() for index in scans], TRAIN_SCANS, "the other scenes")
        return train, test
    kitchen = by_scene.get("redkitchen", [])
    stairs = _evenly(by_scene.get("stairs", []), UNSEEN_SCENE_SCANS, "stairs (the data has no office)")
    late = _late(kitchen)
    test = np.concatenate([_evenly(late, TEST_SCANS - UNSEEN_SCENE_SCANS, "the last fifth of redkitchen"), stairs])
    train = _evenly(kitchen[: len(kitchen) * 3 // 4], TRAIN_SCANS, "the first three quarters of redkitchen")
    return train, test


def _late(scans: list[int]) -> list[int]:
    return scans[len(scans) * 4 // 5 :]


def _evenly(scans: list[int], count: int, where: str) -> NDArray[np.int64]:
    if len(scans) < count:
        raise UserError(f"dataset 7scenes: {count} scans needed of {where}, {len(scans)} there; prepare more frames")
    chosen: NDArray[np.int64] = np.asarray(scans)[np.linspace(0, len(scans) - 1, count).round().astype(int)]
    return chosen


def _scans(dataset: Dataset) -> Split:
    split = dataset.splits["scans"]
    if split.points.shape[1] < POINTS:
        raise UserError(
            f"dataset 7scenes has {split.points.shape[1]} points a frame; prepare it with --points {POINTS}"
        )
    return split


def normalised(cloud: Cloud) -> Cloud:
    """Return the cloud scaled by the longest side of its box, then centred (FMR's)."""
    scaled: Cloud = cloud / np.ptp(cloud, axis=0).max()
    scaled -= scaled.mean(axis=0)
    return scaled


@dataclass(frozen=True, kw_only=True)
class MovedScans(Protocol):
    """One test frame for each problem, the target its moved copy."""

    def open(self, data_dir: Path) -> ProblemSet:
        """Open the problems; see `Protocol.open`."""
        dataset = open_dataset("7scenes", data_dir)
        split = _scans(dataset)
        _, test = split_scans(split.ids)
        return MovedCopies(
            protocol=self.id,
            clouds=lambda index: normalised(np.asarray(split.points[test[index], :POINTS], dtype=np.float64)),
            labels=[dataset.label_names[split.labels[scan]] for scan in test],
            ids=[split.ids[scan] for scan in test],
            make=lambda cloud, T, protocol, index: copied(cloud, T, protocol, index, noise="none"),
            data_sha256=dataset.sha256,
        )


@dataclass(frozen=True, kw_only=True)
class FramePairs(Protocol):
    """Two frames, 20 apart, of a test sequence; the truth from the camera poses.

    Both clouds are centred on the source's centroid and scaled by the longest side of the source's box, each in its
    own camera's frame.
    """

    def open(self, data_dir: Path) -> ProblemSet:
        """Open the problems; see `Protocol.open`."""
        dataset = open_dataset("7scenes", data_dir)
        return _FramePairSet(self.id, dataset, _scans(dataset))


class _FramePairSet(ProblemSet):
    def __init__(self, protocol: str, dataset: Dataset, split: Split) -> None:
        if split.poses is None:
            raise UserError("dataset 7scenes has no camera poses; prepare it again")
        self.protocol, self.data_sha256 = protocol, dataset.sha256
        self._split, self._poses, self._dataset = split, split.poses, dataset
        order = sorted(range(len(split.ids)), key=lambda index: split.ids[index])
        offices = [index for index in order if split.ids[index].startswith("office/")]
        kitchen = [index for index in order if split.ids[index].startswith("redkitchen/")]
        by_id = {split.ids[index]: index for index in offices or _late(kitchen)}
        pairs = [(index, by_id[later]) for name, index in by_id.items() if (later := _later_frame(name)) in by_id]
        chosen = _evenly(list(range(len(pairs))), TEST_SCANS, f"test frames with another {FRAME_GAP} frames later")
        self._pairs = [pairs[index] for index in chosen]

    def __len__(self) -> int:
        return len(self._pairs)

    def pair(self, index: int) -> Pair:
        """Return problem `index` with its answer."""
        earlier, later = self._pairs[index]
        source, target = (
            self._points(frame, index, which) for frame, which in ((earlier, "source"), (later, "target"))
        )
        T_metres = invert(self._poses[later]) @ self._poses[earlier]
        centre, scale = source.mean(axis=0), float(np.ptp(source, axis=0).max())
        source, target = (source - centre) / scale, (target - centre) / scale
        # y = R x + t in metres becomes, with x = s u + c and y = s v + c, v = R u + (R c + t - c) / s.
        R = T_metres[:3, :3]
        T = se3(R, (R @ centre + T_metres[:3, 3] - centre) / scale)
        return Pair(
            source=source,
            target=target,
            T_target_source=T,
            label=self._dataset.label_names[self._split.labels[earlier]],
            id=f"{self._split.ids[earlier]} -> {self._split.ids[later]}",
            clean_source=source,
            clean_target=target,
        )

    def _points(self, frame: int, index: int, which: str) -> Cloud:
        points = self._split.points[frame]
        chosen = generator(self.protocol, index, f"points of {which}").permutation(len(points))[:POINTS]
        return np.asarray(points[chosen], dtype=np.float64)


def _later_frame(name: str) -> str:
    """Return the id of the frame 20 after: 'redkitchen/seq-01/frame-000800' -> '.../frame-000820'."""
    return re.sub(r"\d+$", lambda number: f"{int(number[0]) + FRAME_GAP:0{len(number[0])}d}", name)


CLEAN = MovedScans(
    name="7scenes/clean",
    version=1,
    description="the paper's 7Scene table: one depth frame, 784 points, target = moved copy",
    dataset="7scenes",
    published="7scene",
)

FRAMES = FramePairs(
    name="7scenes/frames",
    version=1,
    description="two real frames, 20 apart, 784 points each, ground truth from the camera poses",
    dataset="7scenes",
    headline_metrics=("rre_median_deg", "rte_median", "recall_5deg", "recall_15deg"),
)
