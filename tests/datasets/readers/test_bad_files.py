"""Whatever is in a file: a UserError of one line that names it, no other exception, no absurd allocation."""

import io
import resource
import subprocess
import sys
import textwrap
import warnings
import zlib

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image

from regbench.datasets.readers.cloud import read_cloud
from regbench.datasets.readers.h5 import read_h5_array
from regbench.datasets.readers.off import read_off
from regbench.datasets.readers.png import read_depth_png
from regbench.datasets.readers.toml import read_toml
from regbench.datasets.readers.transform import read_transform
from regbench.errors import UserError

XYZ = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
NAN = np.array([[0.0, np.nan, 0]])


def _ply(kind):
    header = f"ply\nformat {kind} 1.0\nelement vertex 4\n" + "".join(f"property float {axis}\n" for axis in "xyz")
    order = {"ascii": None, "binary_little_endian": "<f4", "binary_big_endian": ">f4"}[kind]
    body = b"0 0 0\n1 0 0\n0 1 0\n0 0 1\n" if order is None else XYZ.astype(order).tobytes()
    return header.encode() + b"end_header\n" + body


def _pcd(kind):
    header = f"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 4\nHEIGHT 1\nPOINTS 4\nDATA {kind}\n"
    body = {
        "ascii": b"0 0 0\n1 0 0\n0 1 0\n0 0 1\n",
        "binary": XYZ.astype("<f4").tobytes(),
        "binary_compressed": (50).to_bytes(4, "little")
        + (48).to_bytes(4, "little")
        + b"\x1f"
        + XYZ.T.astype("<f4").tobytes()[:32]
        + b"\x0f"
        + XYZ.T.astype("<f4").tobytes()[32:],
    }[kind]
    return header.encode() + body


def _npy(array=XYZ):
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


def _png():
    file = io.BytesIO()
    Image.fromarray(np.arange(64, dtype=np.uint16).reshape(8, 8)).save(file, "PNG")
    return file.getvalue()


def _claiming(png, width, height):
    """Return the PNG with another size in its header, the header's checksum right."""
    header = b"IHDR" + width.to_bytes(4, "big") + height.to_bytes(4, "big") + png[24:29]
    return png[:12] + header + zlib.crc32(header).to_bytes(4, "big") + png[33:]


def _h5():
    file = io.BytesIO()
    with h5py.File(file, "w") as h5:
        h5.create_dataset("data", data=XYZ.astype(np.float32), compression="gzip")
    return file.getvalue()


def _read_h5(path):
    return read_h5_array(path, "data")


POSE = b"1 0 0 0.5\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"
OFF = b"OFF\n4 2 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 1 2\n3 0 2 3\n"
CASES = {
    "ascii.ply": (read_cloud, _ply("ascii")),
    "little.ply": (read_cloud, _ply("binary_little_endian")),
    "big.ply": (read_cloud, _ply("binary_big_endian")),
    "ascii.pcd": (read_cloud, _pcd("ascii")),
    "binary.pcd": (read_cloud, _pcd("binary")),
    "compressed.pcd": (read_cloud, _pcd("binary_compressed")),
    "mesh.off": (read_off, OFF),
    "cloud.off": (read_cloud, OFF),
    "cloud.npy": (read_cloud, _npy()),
    "cloud.xyz": (read_cloud, b"0 0 0\n1 0 0\n0 1 0\n0 0 1\n"),
    "depth.png": (read_depth_png, _png()),
    "pack.h5": (_read_h5, _h5()),
    "config.toml": (read_toml, b"method = ['icp']\n[deep]\nlimit = 3\n"),
    "pose.txt": (read_transform, POSE),
}
each_format = pytest.mark.parametrize("name", CASES)


def _refused(reader, path):
    """Read, and return the message of the UserError, or None where the file was read."""
    message = None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # a warning would be further lines beside the one
            reader(path)
    except UserError as error:
        message = str(error)
    assert message is None or (str(path).replace("\0", "\\x00") in message and "\n" not in message)
    return message


@each_format
def test_the_valid_file_is_read(tmp_path, name):
    reader, content = CASES[name]
    (tmp_path / name).write_bytes(content)
    assert _refused(reader, tmp_path / name) is None
    if reader is read_cloud:
        np.testing.assert_array_equal(read_cloud(tmp_path / name), XYZ)


@each_format
def test_missing_folder_and_empty(tmp_path, name):
    reader, _ = CASES[name]
    path = tmp_path / name
    assert "no such file" in _refused(reader, path)
    path.mkdir()
    assert "is a folder" in _refused(reader, path)
    path.rmdir()
    path.write_bytes(b"")
    assert _refused(reader, path)
    for odd, message in ((tmp_path / ("x" * 300 + name), "File name too long"), (tmp_path / f"\0{name}", "null byte")):
        assert message in _refused(reader, odd)
    assert "no such file" in _refused(reader, path / name)


@each_format
def test_truncated_anywhere_is_refused_or_whole(tmp_path, name):
    """Cutting a file never yields other data than the whole file does."""
    reader, content = CASES[name]
    path = tmp_path / name
    path.write_bytes(content)
    whole = reader(path)
    # HDF5 is read in a process of its own each time: 150 cuts, else it would be three minutes.
    cuts = range(0, len(content), max(1, len(content) // 150) if name == "pack.h5" else 1)
    refused = 0
    for length in cuts:
        path.write_bytes(content[:length])
        if _refused(reader, path):
            refused += 1
        elif reader is read_cloud and b"\n0 0 1" not in content:
            np.testing.assert_array_equal(reader(path), whole)
    assert refused > len(cuts) / 3 or name in ("config.toml", "cloud.xyz")


@each_format
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(noise=st.binary(max_size=300))
def test_arbitrary_bytes(tmp_path, name, noise):
    reader, _ = CASES[name]
    (tmp_path / name).write_bytes(noise)
    _refused(reader, tmp_path / name)


@each_format
@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_mutated_files(tmp_path, name, data):
    reader, content = CASES[name]
    mutated = bytearray(content)
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(mutated) - 1))
        mutated[at : at + data.draw(st.integers(0, 3))] = data.draw(st.binary(max_size=4))
        mutated = mutated or bytearray(b" ")
    (tmp_path / name).write_bytes(mutated)
    _refused(reader, tmp_path / name)


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("ascii.ply", b"vertex 4", b"vertex 999999999999"),
        ("little.ply", b"vertex 4", b"vertex 999999999999"),
        ("ascii.pcd", b"POINTS 4", b"POINTS 999999999999"),
        ("binary.pcd", b"POINTS 4", b"POINTS 999999999999"),
        ("binary.pcd", b"COUNT 1 1 1", b"COUNT 1 1 999999"),
        ("compressed.pcd", b"POINTS 4", b"POINTS 999999999999"),
        ("compressed.pcd", (48).to_bytes(4, "little"), (2**32 - 1).to_bytes(4, "little")),
        ("mesh.off", b"4 2 0", b"999999999999 2 0"),
        ("mesh.off", b"4 2 0", b"4 999999999999 0"),
        ("cloud.npy", b"(4, 3)", b"(999999999, 3)"),
        ("cloud.npy", b"(4, 3)", b"(2305843009213693956, 3)"),  # 24 * (2^61 + 4) wraps round to the 96 that are there
        ("pack.h5", (4).to_bytes(8, "little"), (2**40).to_bytes(8, "little")),
    ],
)
def test_a_lying_header_allocates_nothing(tmp_path, name, old, new):
    """Read in a process with 2 GiB of address space: a MemoryError would show."""
    _, content = CASES[name]
    assert old in content
    path = tmp_path / name
    path.write_bytes(content.replace(old, new))
    reader = "read_h5_array(Path(sys.argv[1]), 'data')" if name.endswith("h5") else "read_cloud(Path(sys.argv[1]))"
    code = f"""
        import sys
        from pathlib import Path
        from regbench.datasets.readers.cloud import read_cloud
        from regbench.datasets.readers.h5 import read_h5_array
        from regbench.errors import UserError
        try:
            {reader}
        except UserError as error:
            print("refused:", error)
    """
    limit = 2 * 2**30
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code), path],
        capture_output=True,
        text=True,
        timeout=60,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (limit, limit)),
    )
    assert done.stdout.startswith(f"refused: {path}"), done.stdout + done.stderr
    assert "MemoryError" not in done.stdout
    assert "Unable to allocate" not in done.stdout


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.npy", None, "not"),
        ("a.ply", b"ply\nformat ascii 1.0\nelement face 0\nend_header\n", "no element 'vertex'"),
        ("a.ply", _ply("ascii").replace(b"property float z\n", b""), "no x, y and z"),
        ("a.ply", _ply("ascii").replace(b"0 0 1", b"0 0 nan"), "1 of 4 points are not finite"),
        ("a.ply", _ply("ascii").replace(b"0 0 1", b"0 0 one"), "text where numbers"),
        ("a.ply", _ply("ascii").replace(b"vertex 4", b"vertex 0"), "no points"),
        ("a.ply", _ply("ascii").replace(b"float z", b"string z"), "cannot read the header line 'property string z'"),
        ("a.ply", _ply("ascii").replace(b"property float z", b"property list uchar int z"), "list properties"),
        ("a.ply", _ply("binary_little_endian")[:-12] + NAN.astype("<f4").tobytes(), "1 of 4 points are not finite"),
        ("a.ply", _ply("binary_big_endian")[:-12] + b"\x7f\x80\0\1" * 3, "1 of 4 points are not finite"),  # signalling
        ("a.off", b"solid x\nfacet\n", "not an ASCII OFF file"),
        ("a.off", OFF.replace(b"0 0 1", b"0 0 one"), "text where numbers"),
        ("a.off", OFF.replace(b"3 0 2 3", b"3 0 2 1e999"), "names a vertex that is not there"),
        ("a.off", OFF.replace(b"3 0 2 3", b"3 0 2 4"), "names a vertex that is not there"),
        ("a.off", OFF.replace(b"3 0 2 3", b"3 0 2 1.5"), "names a vertex that is not there"),
        ("a.off", OFF.replace(b"0 0 1", b"0 0 inf"), "1 vertices are not finite"),
        ("a.pcd", _pcd("ascii").replace(b"DATA ascii", b"DATA zip"), "unknown DATA 'zip'"),
        ("a.pcd", _pcd("ascii").replace(b"0 0 1", b"0 0 inf"), "1 of 4 points are not finite"),
        ("a.pcd", _pcd("ascii").replace(b"0 0 1", b"0 0 one"), "text where numbers"),
        ("a.pcd", _pcd("ascii").replace(b"TYPE F F F", b"TYPE F F S"), "field 'z' has an unknown type"),
        ("a.pcd", _pcd("ascii").replace(b"FIELDS x y z", b"FIELDS x y w"), "needs one field 'z'"),
        ("a.pcd", _pcd("binary")[:-12] + NAN.astype("<f4").tobytes(), "1 of 4 points are not finite"),
        ("a.npy", _npy(np.vstack([XYZ, NAN])), "1 of 5 points are not finite"),
        ("a.npy", _npy(XYZ.astype(complex)), "not an array of numbers (complex128)"),
        ("a.npy", _npy(XYZ.astype("U4")), "not an array of numbers (<U4)"),
        ("a.npy", _npy(XYZ.astype("M8[s]")), "not an array of numbers (datetime64[s])"),
        ("a.npy", _npy(XYZ.ravel()), "expected an array of shape (N, 3), got (12,)"),
        ("a.xyz", b"1 2 3\n4 5 nan\n", "1 of 2 points are not finite"),
        ("a.xyz", b"1 2 3\n4 5 six\n", "text where numbers"),
        ("a.xyz", b"1 2\n3 4\n", "have 2 numbers"),
        ("a.xyz", b"1 2 3\n4 5\n", "not every line"),
        ("a.stl", b"solid", "unknown format '.stl'"),
    ],
)
def test_messages_of_clouds(tmp_path, name, content, message):
    path = tmp_path / name
    if content is None:
        np.save(path, np.array([{"a": 1}], dtype=object), allow_pickle=True)  # must never be unpickled
    else:
        path.write_bytes(content)
    reader = read_off if name.endswith(".off") else read_cloud
    assert message in _refused(reader, path)


def test_messages_of_the_other_formats(tmp_path):
    png = tmp_path / "rgb.png"
    Image.fromarray(np.zeros((4, 4, 3), np.uint8)).save(png)
    assert "not a 16-bit greyscale image (mode RGB)" in _refused(read_depth_png, png)
    Image.fromarray(np.zeros((4, 4), np.uint8)).save(png)
    assert "not a 16-bit greyscale image (mode L)" in _refused(read_depth_png, png)
    Image.fromarray(np.zeros((4, 4, 3), np.uint8)).save(png, "JPEG")
    assert "not a PNG image" in _refused(read_depth_png, png)
    for width, height in ((8192, 11_000), (30_000, 30_000), (16_385, 8)):  # Pillow warns of the first, refuses the next
        png.write_bytes(_claiming(_png(), width, height))
        assert _refused(read_depth_png, png)
    pose = tmp_path / "pose.txt"
    for content, message in (
        (POSE[:-8], "16 numbers, this file has 12"),
        (POSE.replace(b"0.5", b"nan"), "not finite"),
        (POSE.replace(b"0.5", b"half"), "half"),
        (b"0 0 0 1\n" * 3 + b"0 0 1 1\n", "last row"),
    ):
        pose.write_bytes(content)
        assert message in _refused(read_transform, pose)
    toml = tmp_path / "bad.toml"
    toml.write_text("a = [1,\n")
    assert "not a readable TOML file" in _refused(read_toml, toml)
    for content in (b"a = \xff\n", b"a = 1\na = 2\n", b"a = " + b"[" * 5000, b"\0", b"a = " + b"9" * 5000):
        toml.write_bytes(content)
        assert "not a readable TOML file" in _refused(read_toml, toml)
    pack = tmp_path / "pack.h5"
    with h5py.File(pack, "w") as h5:
        h5["words"] = np.array([b"a"])
        h5["nan"] = np.array([np.nan])
        h5["complex"] = np.array([1j])
        h5["scalar"] = 3.0
        h5["nothing"] = h5py.Empty("f4")
        h5.create_group("group")
    for key, message in (
        ("data", "no array 'data' (it has complex, group, nan, nothing, scalar, words)"),
        ("group", "no array 'group'"),
        ("complex", "not an array of numbers (complex128)"),
        ("scalar", "not an array of numbers"),
        ("nothing", "not an array of numbers"),
        ("words", "not an array of numbers"),
        ("nan", "not finite"),
    ):
        with pytest.raises(UserError) as caught:
            read_h5_array(pack, key)
        assert message in str(caught.value)
