"""Downloads against real HTTP servers on the loopback, some of which misbehave."""

import hashlib
import http.server
import io
import re
import threading
import zipfile

import pytest
from regbench_data_prep import download, mirrors
from regbench_data_prep.download import get, get_archive
from regbench_data_prep.fetch import IncompleteError, fetch
from regbench_data_prep.mirrors import DOWNLOADS, Archive, Download

from regbench.errors import UserError


def make_zip():
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("data/a.txt", "content")
        archive.writestr("data/noise.bin", bytes(range(256)) * 4000)
    return file.getvalue()


CONTENT = make_zip()
SHA256 = "sha256:" + hashlib.sha256(CONTENT).hexdigest()


class Handler(http.server.BaseHTTPRequestHandler):
    """Serves `server.content`; `server.cuts` says after how many bytes each connection in turn is broken."""

    protocol_version = "HTTP/1.0"

    def do_GET(self):
        server = self.server
        asked = self.headers.get("Range")
        server.requests.append((self.path, asked))
        if self.path == "/missing.zip":
            self.send_error(404)
            return
        start = int(re.match(r"bytes=(\d+)-", asked)[1]) if asked and server.ranges else 0
        if self.headers.get("If-Range", server.etag) != server.etag:
            start = 0
        if start >= len(server.content):
            self.send_error(416)
            return
        body = server.content[start:]
        self.send_response(206 if start else 200)
        if start:
            self.send_header("Content-Range", f"bytes {start}-{len(server.content) - 1}/{len(server.content)}")
        if server.etag:
            self.send_header("ETag", server.etag)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        cut = server.cuts.pop(0) if server.cuts else None
        self.wfile.write(body[:cut])

    def log_message(self, *args):
        pass


@pytest.fixture
def serve():
    servers = []

    def start(content=CONTENT, *, ranges=True, cuts=(), etag='"1"'):
        server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        server.content, server.ranges, server.cuts, server.etag, server.requests = content, ranges, list(cuts), etag, []
        threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True).start()
        servers.append(server)
        server.url = f"http://127.0.0.1:{server.server_port}"
        return server

    yield start
    for server in servers:
        server.shutdown()
        server.server_close()


def attempt(tmp_path, *urls, digest=SHA256):
    lines = []
    get_archive(Archive("pack.zip", urls, digest), tmp_path / "downloads", tmp_path / "raw", lines.append)
    assert (tmp_path / "raw" / "pack" / "data" / "a.txt").read_text() == "content"
    assert list((tmp_path / "downloads").iterdir()) == []
    return lines


def ranges(server):
    return [asked for _, asked in server.requests]


def test_in_one_go(tmp_path, serve):
    server = serve()
    assert attempt(tmp_path, f"{server.url}/pack.zip") == [f"downloading {server.url}/pack.zip", "unpacking pack.zip"]
    assert ranges(server) == [None]
    assert attempt(tmp_path, f"{server.url}/pack.zip") == [f"pack.zip: already in {tmp_path / 'raw' / 'pack'}"]
    assert ranges(server) == [None]


def test_a_cut_connection_is_resumed(tmp_path, serve):
    server = serve(cuts=[300_000, 200_000])
    attempt(tmp_path, f"{server.url}/pack.zip")
    assert ranges(server) == [None, "bytes=300000-", "bytes=500000-"]


def test_resumed_by_a_later_call_from_another_mirror(tmp_path, serve):
    first = serve(cuts=[300_000, 0])
    with pytest.raises(UserError, match=r"no mirror gave it .*run the command again to go on"):
        attempt(tmp_path, f"{first.url}/pack.zip")
    assert (tmp_path / "downloads" / "pack.zip.part").stat().st_size == 300_000
    second = serve()
    attempt(tmp_path, f"{second.url}/pack.zip")
    assert ranges(second) == ["bytes=300000-"]


def test_a_server_that_ignores_ranges(tmp_path, serve):
    first = serve(cuts=[300_000, 0])
    second = serve(ranges=False)
    attempt(tmp_path, f"{first.url}/pack.zip", f"{second.url}/pack.zip")
    assert ranges(second) == ["bytes=300000-"]


def test_the_next_mirror_after_every_kind_of_failure(tmp_path, serve):
    gone, wrong, good = serve(), serve(b"wrong bytes" * 9999), serve()
    gone.shutdown()
    gone.server_close()
    lines = attempt(
        tmp_path, f"{gone.url}/pack.zip", f"{good.url}/missing.zip", f"{wrong.url}/pack.zip", f"{good.url}/pack.zip"
    )
    text = "\n".join(lines)
    assert "no connection" in text
    assert "the server answers 404" in text
    assert f"expected {SHA256}" in text
    assert good.requests[-1] == ("/pack.zip", None)  # the wrong bytes are not gone on from


def test_wrong_bytes_alone_are_never_unpacked(tmp_path, serve):
    server = serve(make_zip() + b"x")
    with pytest.raises(UserError, match=r"pack.zip: no mirror gave it"):
        attempt(tmp_path, f"{server.url}/pack.zip")
    assert list((tmp_path / "raw").iterdir()) == list((tmp_path / "downloads").iterdir()) == []


def test_a_part_longer_than_the_file_is_dropped(tmp_path, serve):
    server = serve()
    part = tmp_path / "downloads" / "pack.zip.part"
    part.parent.mkdir()
    part.write_bytes(CONTENT + b"more")
    attempt(tmp_path, f"{server.url}/first.zip", f"{server.url}/second.zip")
    assert ranges(server) == [f"bytes={len(CONTENT) + 4}-", None]


def test_without_a_published_checksum_it_says_so_and_gives_its_own(tmp_path, serve):
    server = serve(cuts=[300_000])
    lines = attempt(tmp_path, f"{server.url}/pack.zip", digest=None)
    assert f"pack.zip: no published checksum to check it against; what came has {SHA256}" in lines
    assert ranges(server) == [None, "bytes=300000-"]


def test_without_a_checksum_a_changed_file_starts_anew(tmp_path, serve):
    old = serve(b"old" * 100_000, cuts=[100_000, 0], etag='"old"')
    part = tmp_path / "file.part"
    with pytest.raises(IncompleteError, match="the connection broke after 100000 of 300000 bytes"):
        fetch(f"{old.url}/file", part, resume_without_validator=False, report=print)
    new = serve(etag='"new"')
    fetch(f"{new.url}/file", part, resume_without_validator=False, report=print)
    assert part.read_bytes() == CONTENT
    assert [path.name for path in tmp_path.iterdir()] == ["file.part"]


def test_a_file_put_there_by_hand_is_checked(tmp_path):
    path = tmp_path / "downloads" / "pack.zip"
    path.parent.mkdir()
    path.write_bytes(b"not it")
    with pytest.raises(UserError, match=f"{path}: its checksum is sha256:.*, expected {SHA256}; delete it"):
        attempt(tmp_path)
    path.write_bytes(CONTENT)
    attempt(tmp_path)


def test_get_by_name(tmp_path, serve, monkeypatch):
    server = serve()
    archives = tuple(Archive(f"{name}.zip", (f"{server.url}/{name}.zip",), SHA256) for name in ("one", "two"))
    monkeypatch.setitem(download.DOWNLOADS, "both", Download("7scenes", archives, "a licence"))
    lines = []
    folder = get("both", tmp_path, report=lines.append)
    assert sorted(path.name for path in folder.iterdir()) == ["one", "two"]
    assert lines[0] == "licence of both: a licence"
    assert lines[-1] == f"next: regbench data prepare 7scenes --from {folder} --data {tmp_path}"
    with pytest.raises(UserError, match="no download 'neither'; there are modelnet40, modelnet40-meshes, 7scenes"):
        get("neither", tmp_path, report=print)


def test_the_table_of_mirrors():
    from importlib.metadata import entry_points

    assert set(DOWNLOADS) == {point.name for point in entry_points(group="regbench.downloads")}
    for entry in mirrors.DOWNLOADS.values():
        assert entry.prepares in {point.name for point in entry_points(group="regbench.preparations")}
        for archive in entry.archives:
            assert len(archive.urls) >= 2
            assert archive.digest is None or re.fullmatch(r"sha256:[0-9a-f]{64}|md5:[0-9a-f]{32}", archive.digest)
