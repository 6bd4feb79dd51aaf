"""Archives that behave, and archives that try to leave their folder."""

import io
import stat
import tarfile
import zipfile

import pytest
from regbench_data_prep.archive import unpack

from regbench.errors import UserError


def make_zip(path, members):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members:
            archive.writestr(name, content)
    return path


def make_tar(path, members, mode="w:gz"):
    with tarfile.open(path, mode) as archive:
        for name, content in members:
            info = name if isinstance(name, tarfile.TarInfo) else tarfile.TarInfo(name)
            if info.type == tarfile.REGTYPE:
                info.size = len(content)
            archive.addfile(info, io.BytesIO(content))
    return path


def files(folder):
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def refused(path, tmp_path, message, **options):
    """Unpacking raises, and nothing is made: not the folder, nothing beside it."""
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(UserError) as caught:
        unpack(path, tmp_path / "out", **options)
    assert message in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize("make", [make_zip, make_tar])
def test_files_and_folders(tmp_path, make):
    unpack(make(tmp_path / "a", [("x/a.txt", b"1"), ("x/y/b.txt", b"2"), ("./c.txt", b"")]), tmp_path / "out")
    assert files(tmp_path / "out") == {"x/a.txt": b"1", "x/y/b.txt": b"2", "c.txt": b""}
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "out"]


def test_zips_within_are_unpacked_where_they_lie(tmp_path):
    inner = make_zip(tmp_path / "inner.zip", [("seq-01/frame-000000.pose.txt", b"pose")]).read_bytes()
    path = make_zip(tmp_path / "chess.zip", [("chess/seq-01.zip", inner), ("chess/TestSplit.txt", b"sequence1")])
    unpack(path, tmp_path / "out")
    assert files(tmp_path / "out") == {
        "chess/seq-01/frame-000000.pose.txt": b"pose",
        "chess/TestSplit.txt": b"sequence1",
    }


@pytest.mark.parametrize("make", [make_zip, make_tar])
@pytest.mark.parametrize("name", ["../evil.txt", "a/../../evil.txt", "/tmp/evil.txt", "..\\evil.txt", "C:\\evil.txt"])
def test_members_that_would_leave_the_folder(tmp_path, make, name):
    refused(make(tmp_path / "bad", [("ok.txt", b"1"), (name, b"2")]), tmp_path, "outside its folder")


@pytest.mark.parametrize("kind", [tarfile.SYMTYPE, tarfile.LNKTYPE, tarfile.FIFOTYPE, tarfile.CHRTYPE])
def test_links_and_devices_in_a_tar(tmp_path, kind):
    link = tarfile.TarInfo("link")
    link.type, link.linkname = kind, "/etc/passwd"
    refused(make_tar(tmp_path / "bad", [(link, b""), ("link/x", b"1")]), tmp_path, "a link or a device")


def test_links_in_a_zip(tmp_path):
    link = zipfile.ZipInfo("link")
    link.external_attr = (stat.S_IFLNK | 0o777) << 16
    refused(make_zip(tmp_path / "bad", [(link, "/etc"), ("link/x", "1")]), tmp_path, "a link or a device")


def test_a_nested_zip_cannot_leave_either(tmp_path):
    inner = make_zip(tmp_path / "inner.zip", [("../../evil.txt", b"1")]).read_bytes()
    refused(make_zip(tmp_path / "bad.zip", [("a/b.zip", inner)]), tmp_path, "outside its folder")


@pytest.mark.parametrize("make", [make_zip, make_tar])
def test_bombs(tmp_path, make):
    path = make(tmp_path / "bomb", [("zeros", bytes(10 << 20))])
    assert path.stat().st_size < 1 << 20
    refused(path, tmp_path, "decompression bomb", limit_bytes=1 << 20)
    unpack(path, tmp_path / "out", limit_bytes=10 << 20)


def test_a_nested_bomb_counts_too(tmp_path):
    inner = make_zip(tmp_path / "inner.zip", [("zeros", bytes(10 << 20))]).read_bytes()
    path = make_zip(tmp_path / "bomb.zip", [("a.zip", inner)])
    refused(path, tmp_path, "decompression bomb", limit_bytes=10 << 20)


@pytest.mark.parametrize("content", [b"", b"not an archive", b"PK\x03\x04 but no more"])
def test_not_an_archive(tmp_path, content):
    (tmp_path / "bad").write_bytes(content)
    refused(tmp_path / "bad", tmp_path, "neither a zip nor a tar")


def test_damaged_archives(tmp_path):
    for make in (make_zip, make_tar):
        path = make(tmp_path / f"bad{make.__name__}", [("x.bin", bytes(range(256)) * 400)])
        content = bytearray(path.read_bytes())
        content[len(content) // 3] ^= 0xFF
        path.write_bytes(content)
        refused(path, tmp_path, "broken archive")


def test_a_member_twice_is_refused(tmp_path):
    with pytest.warns(UserWarning, match="Duplicate name"):
        path = make_zip(tmp_path / "bad", [("a", b"1"), ("a", b"2")])
    with pytest.raises(FileExistsError):
        unpack(path, tmp_path / "out")
    assert not (tmp_path / "out").exists()
