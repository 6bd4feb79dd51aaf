"""Where the raw datasets are found, and what their archives must hash to."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Archive:
    """One archive of a download.

    Attributes:
        file: Its name on disk.
        urls: Mirrors, tried in order.
        digest: `sha256:...` or `md5:...`, or None where nobody has published one.
    """

    file: str
    urls: tuple[str, ...]
    digest: str | None


@dataclass(frozen=True)
class Download:
    """All archives of a dataset, and the page that states its licence."""

    prepares: str
    archives: tuple[Archive, ...]
    licence: str


_MICROSOFT = "https://download.microsoft.com/download/2/8/5/28564B23-0828-408F-8631-23B1EFF1DAC8"
_SCENES = ("chess", "fire", "heads", "office", "pumpkin", "redkitchen", "stairs")

# The digests are those that several independent public repositories check against; we have not downloaded these.
DOWNLOADS = {
    "modelnet40": Download(
        prepares="modelnet40",
        archives=(
            Archive(
                "modelnet40_ply_hdf5_2048.zip",
                (
                    "https://shapenet.cs.stanford.edu/media/modelnet40_ply_hdf5_2048.zip",
                    "https://huggingface.co/datasets/Msun/modelnet40/resolve/main/modelnet40_ply_hdf5_2048.zip",
                ),
                "md5:c9ab8e6dfb16f67afdab25e155c79e59",
            ),
        ),
        licence="academic use; https://modelnet.cs.princeton.edu",
    ),
    "modelnet40-meshes": Download(
        prepares="modelnet40",
        archives=(
            Archive(
                "ModelNet40.zip",
                (
                    "https://modelnet.cs.princeton.edu/ModelNet40.zip",
                    "http://modelnet.cs.princeton.edu/ModelNet40.zip",
                ),
                "sha256:42dc3e656932e387f554e25a4eb2cc0e1a1bd3ab54606e2a9eae444c60e536ac",
            ),
        ),
        licence="academic use; https://modelnet.cs.princeton.edu",
    ),
    "7scenes": Download(
        prepares="7scenes",
        archives=tuple(
            Archive(
                f"{scene}.zip",
                (f"{_MICROSOFT}/{scene}.zip", f"{_MICROSOFT}/{scene}.zip".replace("https:", "http:")),
                None,
            )
            for scene in _SCENES
        ),
        licence="non-commercial; https://www.microsoft.com/en-us/research/project/rgb-d-dataset-7-scenes",
    ),
}
