"""Fetches one file over HTTP, resumed where an earlier attempt was cut."""

from __future__ import annotations

import http.client
import re
import shutil
import urllib.error
import urllib.request
from collections.abc import Callable
from pathlib import Path

TIMEOUT_S = 60.0
CHUNK_BYTES = 1 << 20
REPORT_EVERY_BYTES = 100 << 20


class IncompleteError(Exception):
    """A mirror did not give the whole file; the message says why. What came is kept for the next attempt."""


def fetch(
    url: str,
    part: Path,
    *,
    resume_without_validator: bool,
    report: Callable[[str], None],
    timeout_s: float = TIMEOUT_S,
) -> None:
    """Download `url` into `part`, going on from what is there, with a new connection where one breaks.

    A part is continued if the server still has the same file (its ETag or date, kept beside the part), or, with
    `resume_without_validator`, in any case: then the caller must check a digest. A server that does not know ranges
    sends the whole file, and the part starts anew.

    Raises:
        IncompleteError: The server refuses, or the connection broke and a new one brought nothing more.
        OSError: The part cannot be written.
    """
    while True:
        before = _size(part)
        try:
            _fetch_once(url, part, resume_without_validator, report, timeout_s)
        except IncompleteError:
            if _size(part) <= before:
                raise
        else:
            _validator_path(part).unlink(missing_ok=True)
            return


def _fetch_once(
    url: str, part: Path, resume_without_validator: bool, report: Callable[[str], None], timeout_s: float
) -> None:
    request = urllib.request.Request(url, headers={"User-Agent": "regbench"})
    start = _size(part)
    kept = _validator_path(part)
    validator = kept.read_text() if kept.exists() else ""
    if start and (validator or resume_without_validator):
        request.add_header("Range", f"bytes={start}-")
        if not resume_without_validator:
            request.add_header("If-Range", validator)
    with _open(request, timeout_s, part) as response:
        resumed = response.status == http.HTTPStatus.PARTIAL_CONTENT
        if resumed and not re.match(rf"bytes {start}-", response.headers.get("Content-Range", "")):
            raise IncompleteError("the server sent another range than was asked for")
        start = start if resumed else 0
        kept.write_text(response.headers.get("ETag") or response.headers.get("Last-Modified") or "")
        length = response.headers.get("Content-Length")
        end = start + int(length) if length is not None else None
        if end is not None and end - start > shutil.disk_usage(part.parent).free:
            raise OSError(28, f"not enough space for {end - start} bytes more")
        with part.open("ab" if resumed else "wb") as file:
            _copy(response, file.write, start, end, report, part.name)
    if end is not None and _size(part) != end:
        raise IncompleteError(f"the connection broke after {_size(part)} of {end} bytes")


def _open(request: urllib.request.Request, timeout_s: float, part: Path) -> http.client.HTTPResponse:
    try:
        response: http.client.HTTPResponse = urllib.request.urlopen(request, timeout=timeout_s)
    except urllib.error.HTTPError as error:
        if error.code == http.HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE:
            part.unlink(missing_ok=True)  # as long as the file or longer: not a part of it
        raise IncompleteError(f"the server answers {error.code} {error.reason}") from error
    except (OSError, http.client.HTTPException) as error:  # URLError is an OSError
        raise IncompleteError(f"no connection ({getattr(error, 'reason', error)})") from error
    return response


def _copy(
    response: http.client.HTTPResponse,
    write: Callable[[bytes], int],
    start: int,
    end: int | None,
    report: Callable[[str], None],
    name: str,
) -> None:
    done, said = start, start
    while True:
        try:
            chunk = response.read1(CHUNK_BYTES)
        except (OSError, http.client.HTTPException) as error:  # reset, timed out, short chunk
            raise IncompleteError(f"the connection broke after {done} bytes ({type(error).__name__})") from error
        if not chunk:
            return
        write(chunk)
        done += len(chunk)
        if done - said >= REPORT_EVERY_BYTES:
            report(f"{name}: {done >> 20} MiB" + (f" of {end >> 20}" if end is not None else ""))
            said = done


def _validator_path(part: Path) -> Path:
    return part.with_name(part.name + ".etag")


def _size(path: Path) -> int:
    return path.stat().st_size if path.exists() else 0
