"""What fuzz.py damages: for each kind of file valid ones, real ones among them, and what reads it."""

import hashlib
import io
import json
import os
import shutil
import struct
import tarfile
import tempfile
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from regbench.errors import UserError

SHARED = Path(os.environ.get("REGBENCH_SHARED_DATA", "shared/data"))
CLOUD = np.random.default_rng(0).normal(size=(20, 3))


@dataclass
class Target:
    """What is fuzzed: valid inputs, and what reads one of them; its folder is new and empty at the start."""

    seeds: Callable[[], list[bytes]]
    read: Callable[[Path, bytes], None]


def in_file(name: str, read: Callable[[Path], object]) -> Callable[[Path, bytes], None]:
    """Return what writes an input to a file of that name and reads it."""

    def write_and_read(folder: Path, data: bytes) -> None:
        path = folder / name
        path.write_bytes(data)
        read(path)

    return write_and_read


def cloud_reader(suffix: str) -> Callable[[Path, bytes], None]:
    from regbench.datasets.readers.cloud import read_cloud

    def read(path: Path) -> None:
        points = read_cloud(path, drop_invalid=path.stat().st_size % 2 == 0)
        assert points.ndim == 2 and points.shape[1] == 3 and np.isfinite(points).all() and len(points), "not a cloud"  # noqa: PT018

    return in_file(f"input{suffix}", read)


def real_files(pattern: str, most_bytes: int = 3000) -> list[bytes]:
    """Return the heads of a few real files, where the shared data is there."""
    return [path.read_bytes()[:most_bytes] for path in sorted(SHARED.rglob(pattern))[:3]] if SHARED.is_dir() else []


def ply_seeds() -> list[bytes]:
    rows = "\n".join(" ".join(map(repr, row)) for row in CLOUD.tolist())
    properties = "".join(f"property float {axis}\n" for axis in "xyz")
    ascii_header = f"ply\nformat ascii 1.0\ncomment c\nelement vertex 20\n{properties}end_header\n"
    mesh = ascii_header.replace("end_header", "element face 1\nproperty list uchar int vertex_indices\nend_header")
    seeds = [(ascii_header + rows + "\n").encode(), (mesh + rows + "\n3 0 1 2\n").encode()]
    for order, kind in (("little", "<f4"), ("big", ">f4")):
        header = f"ply\nformat binary_{order}_endian 1.0\nelement camera 2\nproperty uchar a\nelement vertex 20\n"
        seeds.append(f"{header}{properties}end_header\n".encode() + b"\1\2" + CLOUD.astype(kind).tobytes())
    return seeds + real_files("*.ply")


def pcd_seeds() -> list[bytes]:
    def header(kind, fields="x y z", size="4 4 4", types="F F F", count="1 1 1"):
        return (
            f"# .PCD v0.7\nVERSION 0.7\nFIELDS {fields}\nSIZE {size}\nTYPE {types}\nCOUNT {count}\nWIDTH 20\nHEIGHT 1\n"
            f"VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 20\nDATA {kind}\n"
        ).encode()

    rows = "\n".join(" ".join(f"{value:.6g}" for value in row) for row in CLOUD.tolist()).encode()
    columns = CLOUD.T.astype("<f4").tobytes()
    literal = b"".join(bytes([len(p) - 1]) + p for p in (columns[i : i + 32] for i in range(0, len(columns), 32)))
    zeros = b"\x00\x00" + b"\xe0\xe6\x00"  # one zero, and a copy of 239 more: 20 points at the origin
    more = header("binary", "x y z _ normal", "4 4 4 1 4", "F F F U F", "1 1 1 4 3")
    table = np.zeros(20, np.dtype([("p", "<f4", 3), ("_", "u1", 4), ("n", "<f4", 3)]))
    return [
        header("ascii") + rows + b"\n",
        header("binary") + CLOUD.astype("<f4").tobytes(),
        header("binary_compressed") + struct.pack("<II", len(literal), 240) + literal,
        header("binary_compressed") + struct.pack("<II", len(zeros), 240) + zeros,
        more + table.tobytes(),
        *real_files("*.pcd"),
    ]


def off_seeds() -> list[bytes]:
    vertices = "\n".join(" ".join(map(repr, row)) for row in CLOUD.tolist())
    triangles = "\n".join(f"3 {k} {k + 1} {k + 2}" for k in range(10))
    polygons = "\n".join(f"4 {k} {k + 1} {k + 2} {k + 3} 0.5 0.5 0.5" for k in range(10))
    seeds = [f"OFF\n20 10 0\n{vertices}\n{faces}\n".encode() for faces in (triangles, polygons)]
    small = [path.read_bytes() for path in sorted(SHARED.rglob("*.off"))[:40]] if SHARED.is_dir() else []
    return [*seeds, f"OFF20 10 0\n{vertices}\n{triangles}".encode(), *[data for data in small if len(data) < 20000][:3]]


def npy_seeds() -> list[bytes]:
    seeds = []
    for array in (
        CLOUD,
        CLOUD.astype("<f4"),
        np.asfortranarray(CLOUD),
        CLOUD.astype(">f8"),
        np.arange(60).reshape(20, 3),
    ):
        stream = io.BytesIO()
        np.save(stream, array)
        seeds.append(stream.getvalue())
    for version in ((2, 0), (3, 0)):
        stream = io.BytesIO()
        np.lib.format.write_array(stream, CLOUD, version=version)
        seeds.append(stream.getvalue())
    return seeds


def xyz_seeds() -> list[bytes]:
    rows = CLOUD.tolist()
    return [
        "\n".join(" ".join(map(repr, row)) for row in rows).encode(),
        ("# x y z\n" + "\n".join(",".join(map(repr, [*row, 0.5])) for row in rows) + "\n").encode(),
        *real_files("kitti/**/*.txt"),
    ]


def transform_seeds() -> list[bytes]:
    turned = np.array([[0, -1, 0, 0.5], [1, 0, 0, -0.25], [0, 0, 1, 1e-3], [0, 0, 0, 1]])
    return [
        "\n".join(" ".join(map(repr, row)) for row in T.tolist()).encode() for T in (np.eye(4), turned)
    ] + real_files("*.pose.txt")


def h5_seeds() -> list[bytes]:
    import h5py

    seeds = []
    for options in (
        {},
        {"chunks": (5, 3), "compression": "gzip"},
        {"chunks": (5, 3), "shuffle": True, "fletcher32": True},
    ):
        stream = io.BytesIO()
        with h5py.File(stream, "w") as file:
            file.create_dataset("data", data=CLOUD.astype("f4"), **options)
            file.create_dataset("label", data=np.arange(20))
        seeds.append(stream.getvalue())
    return seeds


def read_h5(path: Path) -> None:
    from regbench.datasets.readers.h5 import read_h5_array

    for key in ("data", "label"):
        read_h5_array(path, key)


def png_seeds() -> list[bytes]:
    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray((np.arange(64 * 48).reshape(48, 64) * 7 % 5000).astype(np.uint16)).save(stream, "PNG")
    return [stream.getvalue()]


def toml_seeds() -> list[bytes]:
    text = (
        'method = ["icp", "fgr[preset=paper]"]\nprotocol = "demo@1"\nlimit = 4\nrepeat = 2\nseed = 1\ntimeout = 5.5\n'
    )
    text += 'memory = 2.0\njobs = 1\nthreads = 1\ndevice = "cpu"\nexecutor = "local"\nfresh = false\nplugin = []\n'
    return [
        text.encode(),
        b'a = {b = 1979-05-27T07:32:00Z, c = [1, 2.5]}\n"x y" = """t"""\n[t.u]\nv = 0x1F\n[[l]]\nw = inf\n',
    ]


def read_config(path: Path) -> None:
    from regbench.datasets.readers.toml import read_toml
    from regbench.runner.config import load_config

    read_toml(path)
    load_config(path, {})


def recipe_seeds() -> list[bytes]:
    return [path.read_bytes() for path in sorted(Path(__file__).parents[1].glob("*/**/weights/*.toml"))[:6]]


def read_recipe(path: Path) -> None:
    from regbench.learning.training.recipe import load_recipe

    words = path.read_bytes().partition(b'trains = "')[2].partition(b'"')[0]  # each seed is another method's
    load_recipe(path, words.decode("utf-8", "replace") or "latentcem", [])


_RUN: dict[str, bytes] = {}


def run_files() -> dict[str, bytes]:
    """Return the files of a real run of three methods, one of which fails."""
    if not _RUN:
        from regbench.runner.plan import RunConfig
        from regbench.runner.run import run

        class Quiet:
            start = row = note = staticmethod(lambda *words: None)

        faulty = Path(__file__).parents[1] / "tests" / "runner" / "faulty_methods.py"
        before = Path.cwd()
        with tempfile.TemporaryDirectory() as name:
            os.chdir(name)  # runs/latest
            config = RunConfig(method=["icp", "identity", "raises"], limit=3, repeat=2, plugin=[str(faulty)], out="run")
            run(config, command=["fuzz"], progress=Quiet())
            _RUN.update(
                {file: Path("run", file).read_bytes() for file in ("manifest.json", "trials.jsonl", "problems.jsonl")}
            )
            os.chdir(before)
    return _RUN


def run_reader(changed: str) -> Callable[[Path, bytes], None]:
    def read(folder: Path, data: bytes) -> None:
        from regbench.report.table import render
        from regbench.runner.journal import Journal

        for name, content in run_files().items():
            (folder / name).write_bytes(data if name == changed else content)
        if changed == "trials.jsonl":
            with Journal(folder / changed):
                pass
        for style in ("csv", "markdown"):
            render([folder], format=style)

    return read


def read_again(folder: Path, data: bytes) -> None:
    """Read what `regbench run` and `regbench reproduce` read of an older manifest."""
    from regbench.report.rundata import read_run
    from regbench.reproduction.replay import replay
    from regbench.reproduction.sameness import compare, in_words, surroundings
    from regbench.runner import rundir

    for name, content in run_files().items():
        (folder / name).write_bytes(data if name == "manifest.json" else content)
    now = json.loads(run_files()["manifest.json"])
    failures = []
    for attempt in (
        lambda: rundir.merge_manifest(rundir.RunDir(folder), now),
        lambda: replay(folder, read_run(folder), folder / "again"),
        lambda: in_words(compare(read_run(folder), read_run(folder)), surroundings(folder, folder)),
    ):
        try:
            attempt()
        except UserError as error:
            failures.append(error)
    if failures:
        raise failures[0]


_STORE: dict[str, bytes] = {}


def store_files() -> dict[str, bytes]:
    """Return the files of a small prepared dataset."""
    if not _STORE:
        from regbench.datasets.dataset import Split
        from regbench.datasets.store_writer import write_dataset

        with tempfile.TemporaryDirectory() as name:
            points = np.random.default_rng(1).normal(size=(4, 30, 3)).astype(np.float32)
            split = Split(points, np.arange(4), [f"chair/{k}" for k in range(4)], np.stack([np.eye(4)] * 4))
            write_dataset(
                Path(name),
                "7scenes",
                description="d",
                label_names=["a", "b", "c", "d"],
                splits={"scans": split},
                options={},
                left_out={},
                remarks={},
            )
            _STORE.update({path.name: path.read_bytes() for path in sorted(Path(name, "7scenes").iterdir())})
    return _STORE


def read_store(folder: Path, data: bytes) -> None:
    """The input's first byte says which file it stands for; the manifest is made to agree with its size and hash."""
    from regbench.datasets.store import open_prepared
    from regbench.datasets.store_writer import MANIFEST, content_sha256

    (folder / "7scenes").mkdir(exist_ok=True)
    names = list(store_files())
    name, data = names[(data[:1] or b"\0")[0] % len(names)], data[1:]
    files = {**store_files(), name: data}
    if name != MANIFEST:
        manifest = json.loads(files[MANIFEST])
        manifest["files"][name] |= {"bytes": len(data), "sha256": hashlib.sha256(data).hexdigest()}
        manifest["sha256"] = content_sha256(manifest["label_names"], manifest["files"])
        files[MANIFEST] = json.dumps(manifest).encode()
    else:
        try:  # past the hash over the hashes, or nothing behind it is ever reached
            manifest = json.loads(data)
            manifest["sha256"] = content_sha256(manifest["label_names"], manifest["files"])
            files[MANIFEST] = json.dumps(manifest).encode()
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
            pass
    for each, content in files.items():
        (folder / "7scenes" / each).write_bytes(content)
    opened = open_prepared(folder, "7scenes", verify=True)
    for split in opened.splits.values():
        np.array(split.points)


def store_seeds() -> list[bytes]:
    return [bytes([number]) + content for number, content in enumerate(store_files().values())]


def weight_seeds() -> list[bytes]:
    import torch
    from safetensors.torch import save

    return [
        save({"weight": torch.ones(3, 4), "bias": torch.zeros(3)}),
        save({"x": torch.ones(1)}),
    ]


def read_weights(folder: Path, data: bytes) -> None:
    """Read weights with a card whose SHA-256 is theirs: what a forger would write."""
    from torch import nn

    from regbench.learning.weights import load_weights

    path = folder / "w.safetensors"
    path.write_bytes(data)
    path.with_suffix(".json").write_text(json.dumps({"sha256": hashlib.sha256(data).hexdigest()}))
    load_weights(path).load_into(nn.Linear(4, 3))


def card_seeds() -> list[bytes]:
    cards = sorted(Path(__file__).parents[1].glob("*/**/weights/*.json"))
    sha256 = hashlib.sha256(weight_seeds_cached()[0]).hexdigest()
    contents = [json.loads(path.read_bytes()) | {"sha256": sha256} for path in cards[:6]]
    figures = {"icp": {"demo@1": {"cpu": {"n": 3, "rmse_r_deg": 2.0}}}}
    return [json.dumps(each).encode() for each in [*contents, {"sha256": sha256, "test": figures}]]


def read_card(folder: Path, data: bytes) -> None:
    from regbench.learning.weights import add_test_figures, load_weights

    (folder / "w.safetensors").write_bytes(weight_seeds_cached()[0])
    (folder / "w.json").write_bytes(data)
    failure = None
    try:
        load_weights(folder / "w.safetensors")
    except UserError as error:
        failure = error
    add_test_figures(folder / "w.safetensors", {"icp": {"demo@1": {"cpu": {"n": 5, "rmse_r_deg": 1.0}}}})
    if failure:
        raise failure


_WEIGHTS: list[bytes] = []


def weight_seeds_cached() -> list[bytes]:
    if not _WEIGHTS:
        _WEIGHTS.extend(weight_seeds())
    return _WEIGHTS


def checkpoint_seeds() -> list[bytes]:
    import torch

    seeds = []
    for content in ({"a.weight": torch.ones(3, 4)}, {"state_dict": {"module.x": torch.zeros(2)}}):
        for zipped in (True, False):
            stream = io.BytesIO()
            torch.save(content, stream, _use_new_zipfile_serialization=zipped)
            seeds.append(stream.getvalue())
    return seeds


def read_checkpoint(path: Path) -> None:
    from regbench.learning.checkpoint_import import read_state

    read_state(path)


def pairs_seeds() -> list[bytes]:
    return [
        b"source,target,T_target_source\na.npy,b.xyz,t.txt\nb.xyz,a.npy,\n",
        b'source,target\n"a.npy",b.xyz\n',
        "\ufeffsource,target\r\na.npy,b.xyz\r\n".encode(),
    ]


def read_pairs(folder: Path, data: bytes) -> None:
    from regbench.protocols.pairs import PairsProtocol

    np.save(folder / "a.npy", CLOUD)
    (folder / "b.xyz").write_bytes(xyz_seeds()[0])
    (folder / "t.txt").write_bytes(transform_seeds()[0])
    (folder / "pairs.csv").write_bytes(data)
    problems = PairsProtocol.of_folder(folder).open(folder)
    for index in range(min(2, len(problems))):
        problems.pair(index)


def archive_seeds() -> list[bytes]:
    inner, outer = io.BytesIO(), io.BytesIO()
    with zipfile.ZipFile(inner, "w") as archive:
        archive.writestr("seq/frame.txt", "inner")
    with zipfile.ZipFile(outer, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a/b.txt", "hello " * 50)
        archive.writestr("a/nested.zip", inner.getvalue())
        archive.writestr("../../escaped.txt", "no")
    plain = io.BytesIO()
    with zipfile.ZipFile(plain, "w") as archive:
        archive.writestr("a/b.txt", "hello")
        archive.writestr("c.txt", "there")
    seeds = [outer.getvalue(), plain.getvalue(), inner.getvalue()]
    for mode in ("w", "w:gz"):
        stream = io.BytesIO()
        with tarfile.open(fileobj=stream, mode=mode) as archive:
            for name in ("a/b.txt", "c.txt"):
                info = tarfile.TarInfo(name)
                info.size = 5
                archive.addfile(info, io.BytesIO(b"hello"))
            link = tarfile.TarInfo("a/link")
            link.type, link.linkname = tarfile.SYMTYPE, "/etc"
            if mode == "w":
                archive.addfile(link)
        seeds.append(stream.getvalue())
    return seeds


def read_archive(folder: Path, data: bytes) -> None:
    from regbench_data_prep.archive import unpack

    path, target = folder / "deep" / "er" / "input.zip", folder / "deep" / "er" / "out"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)
    try:
        unpack(path, target, limit_bytes=1 << 20)
    except OSError as error:  # documented; its caller makes a UserError of it
        raise UserError(str(error)) from error
    finally:
        inside = {path, path.parent, path.parent.parent}
        strangers = [each for each in folder.rglob("*") if each not in inside and target not in (each, *each.parents)]
        links = [each for each in target.rglob("*") if each.is_symlink()]
        shutil.rmtree(folder / "deep", ignore_errors=True)
        assert not strangers, f"outside its folder: {strangers}"
        assert not links, f"a link: {links}"


TARGETS = {
    "ply": Target(ply_seeds, cloud_reader(".ply")),
    "pcd": Target(pcd_seeds, cloud_reader(".pcd")),
    "off": Target(off_seeds, cloud_reader(".off")),
    "npy": Target(npy_seeds, cloud_reader(".npy")),
    "xyz": Target(xyz_seeds, cloud_reader(".xyz")),
    "transform": Target(
        transform_seeds,
        in_file("t.txt", lambda path: __import__("regbench.protocols.pairs", fromlist=["_"])._read_truth(path)),
    ),
    "h5": Target(h5_seeds, in_file("input.h5", read_h5)),
    "png": Target(
        png_seeds,
        in_file("d.png", lambda path: __import__("regbench.datasets.readers.png", fromlist=["_"]).read_depth_png(path)),
    ),
    "toml": Target(toml_seeds, in_file("run.toml", read_config)),
    "recipe": Target(recipe_seeds, in_file("recipe.toml", read_recipe)),
    "pairs": Target(pairs_seeds, read_pairs),
    "store": Target(store_seeds, read_store),
    "journal": Target(lambda: [run_files()["trials.jsonl"]], run_reader("trials.jsonl")),
    "problems": Target(lambda: [run_files()["problems.jsonl"]], run_reader("problems.jsonl")),
    "manifest": Target(lambda: [run_files()["manifest.json"]], run_reader("manifest.json")),
    "manifest-again": Target(lambda: [run_files()["manifest.json"]], read_again),
    "weights": Target(weight_seeds, read_weights),
    "card": Target(card_seeds, read_card),
    "checkpoint": Target(checkpoint_seeds, in_file("c.pth", read_checkpoint)),
    "archive": Target(archive_seeds, read_archive),
}
