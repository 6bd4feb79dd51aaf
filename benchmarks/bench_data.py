"""What preparing data costs, beside trimesh and open3d on the same input.

python benchmarks/bench_data.py [--shared DIR]
"""

from __future__ import annotations

import argparse
import os
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from regbench_data_prep import modelnet40, seven_scenes
from regbench_data_prep.depth import project_depth
from regbench_data_prep.mesh_sampling import sample_mesh

from regbench.datasets import cad_demo
from regbench.datasets.readers.off import read_off
from regbench.datasets.readers.png import read_depth_png
from regbench.datasets.surface import sample_surface
from regbench.native import load_libusb

SHARED = Path(os.environ.get("REGBENCH_SHARED_DATA", Path(__file__).resolve().parents[2] / "shared" / "data"))
POINTS = 1024


def interleaved_ms(contenders: dict[str, Callable[[], object]], rounds: int) -> dict[str, float]:
    """Return each contender's median time in ms: taken in turns, so that a busy moment hits all alike."""
    samples: dict[str, list[float]] = {name: [] for name in contenders}
    for run in contenders.values():
        run()
    for _ in range(rounds):
        for name, run in contenders.items():
            start = time.perf_counter_ns()
            run()
            samples[name].append((time.perf_counter_ns() - start) / 1e6)
    return {name: statistics.median(values) for name, values in samples.items()}


def show(title: str, medians: dict[str, float]) -> None:
    """Print the medians, and how many times longer than the first each took."""
    first = next(iter(medians.values()))
    print(title)
    for name, median in medians.items():
        print(f"  {name:<34}{median:>10.2f} ms{median / first:>9.2f} x")


def bench_preparations(shared: Path) -> None:
    """Prepare both datasets in full, into a temporary folder."""
    with tempfile.TemporaryDirectory() as folder:
        for name, prepare, source in (
            ("modelnet40, 12,311 shapes of the HDF5 pack", modelnet40.prepare, shared / "modelnet40_ply_hdf5_1024"),
            ("7scenes, 512 frames", seven_scenes.prepare, shared / "7scenes"),
        ):
            times = []
            for run in range(3):
                start = time.perf_counter()
                prepare(source, Path(folder) / str(run), report=lambda line: None)
                times.append(time.perf_counter() - start)
            print(f"prepare {name}: median {statistics.median(times):.2f} s, all {[round(t, 2) for t in times]}")


def bench_meshes(shared: Path) -> None:
    """Read and sample the original meshes."""
    import open3d as o3d
    import trimesh

    paths = sorted((shared / "modelnet40_off_sample").rglob("*.off"))
    ours = [read_off(path) for path in paths]
    theirs = [trimesh.Trimesh(mesh.vertices, mesh.faces, process=False) for mesh in ours]
    opened = [
        o3d.geometry.TriangleMesh(o3d.utility.Vector3dVector(m.vertices), o3d.utility.Vector3iVector(m.faces))
        for m in ours
    ]
    rng = np.random.default_rng(0)

    def sample_trimesh() -> None:
        for mesh in theirs:
            mesh._cache.clear()  # else the areas of the round before are used again
            trimesh.sample.sample_surface(mesh, POINTS, seed=0)

    show(
        f"sample {POINTS} points on each of {len(paths)} meshes in memory, {sum(len(m.faces) for m in ours)} faces",
        interleaved_ms(
            {
                "regbench": lambda: [sample_mesh(mesh.vertices, mesh.faces, POINTS, rng) for mesh in ours],
                "regbench, uncompiled": lambda: [
                    sample_surface(mesh.vertices, mesh.faces, POINTS, rng) for mesh in ours
                ],
                "trimesh": sample_trimesh,
                "open3d": lambda: [mesh.sample_points_uniformly(POINTS) for mesh in opened],
            },
            rounds=15,
        ),
    )

    # open3d does not read the files that run the counts into the keyword: `OFF700 664 0`.
    plain = [path for path in paths if path.read_bytes().startswith(b"OFF\n")]

    def from_file(path: Path) -> object:
        mesh = read_off(path)
        return sample_mesh(mesh.vertices, mesh.faces, POINTS, rng)

    show(
        f"read {len(plain)} .off files and sample {POINTS} points on each",
        interleaved_ms(
            {
                "regbench": lambda: [from_file(path) for path in plain],
                "trimesh": lambda: [
                    trimesh.sample.sample_surface(trimesh.load(path, process=False), POINTS, seed=0) for path in plain
                ],
                "open3d": lambda: [
                    o3d.io.read_triangle_mesh(str(path)).sample_points_uniformly(POINTS) for path in plain
                ],
            },
            rounds=5,
        ),
    )


def bench_depth(shared: Path) -> None:
    """Project one whole depth frame."""
    import open3d as o3d

    depth = read_depth_png(shared / "7scenes" / "redkitchen" / "seq-01" / "frame-000000.depth.png")
    image = o3d.geometry.Image(depth)
    camera = o3d.camera.PinholeCameraIntrinsic(640, 480, 585, 585, 320, 240)
    create = o3d.geometry.PointCloud.create_from_depth_image
    show(
        "project a depth frame of 640 x 480",
        interleaved_ms(
            {
                "regbench": lambda: project_depth(depth),
                "open3d": lambda: create(image, camera, depth_trunc=60.0),
                "open3d, points as an array": lambda: np.asarray(create(image, camera, depth_trunc=60.0).points),
            },
            rounds=60,
        ),
    )


def main() -> None:
    """Run all of them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--shared", type=Path, default=SHARED, help="folder of the raw data")
    shared = parser.parse_args().shared
    load_libusb()
    show("make cad_demo, 336 shapes", interleaved_ms({"regbench": cad_demo._make.__wrapped__}, rounds=5))
    bench_depth(shared)
    bench_meshes(shared)
    bench_preparations(shared)


if __name__ == "__main__":
    main()
