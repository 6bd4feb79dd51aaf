"""Real clouds that overlap in part, as a folder for `pairs:DIR`.

    python benchmarks/extras_pairs.py ../shared/data/extras runs/extras-pairs

Two fused fragments of 7-Scenes' redkitchen, five pairs of the Stanford bunny's range scans, one pair of KITTI's lidar
scans, with the motions that their publishers give.
"""

from __future__ import annotations

import argparse
import shutil
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from regbench.geometry.se3 import invert, se3

BUNNY_PAIRS = (
    ("bun045", "bun000"),
    ("bun090", "bun045"),
    ("bun315", "bun000"),
    ("bun090", "bun000"),
    ("bun315", "bun045"),
)


def bunny_motions(conf: Path) -> dict[str, NDArray[np.float64]]:
    """Return T_model_scan by scan: each line of the file has a translation and a quaternion x y z w, conjugated."""
    motions = {}
    for line in conf.read_text().splitlines():
        if line.startswith("bmesh"):
            _, name, *numbers = line.split()
            values = np.array(numbers, dtype=float)
            motions[Path(name).stem] = se3(Rotation.from_quat(values[3:]).as_matrix().T, values[:3])
    return motions


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("extras", type=Path)
    parser.add_argument("out", type=Path)
    arguments = parser.parse_args()
    extras, out = arguments.extras, arguments.out
    out.mkdir(parents=True, exist_ok=True)
    kitchen, kitti = extras / "3dmatch_redkitchen", extras / "kitti"
    rows = [
        (kitchen / "cloud_bin_4.ply", kitchen / "cloud_bin_0.ply", kitchen / "T_0_4.txt"),
        (kitti / "source.ply", kitti / "target.ply", kitti / "T_target_source.txt"),
    ]
    motions = bunny_motions(extras / "bunny" / "bun.conf")
    for source, target in BUNNY_PAIRS:
        truth = out / f"{source}_{target}.txt"
        np.savetxt(truth, invert(motions[target]) @ motions[source])
        rows.append((extras / "bunny" / f"{source}.ply", extras / "bunny" / f"{target}.ply", truth))
    lines = ["source,target,T_target_source"]
    for row in rows:
        for path in row:
            if path.parent != out:
                shutil.copyfile(path, out / path.name)
        lines.append(",".join(path.name for path in row))
    (out / "pairs.csv").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
