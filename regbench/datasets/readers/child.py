"""Reads in a process of its own what a C library reads: where it crashes on a damaged file, the caller goes on."""

from __future__ import annotations

import json
import os
import signal
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from regbench.errors import UserError


def read_in_child(path: Path, kind: str, read: Callable[[], NDArray[Any]]) -> NDArray[Any]:
    """Return the numeric array that `read` gives, called in a forked process.

    A fork, not a new interpreter: libraries are imported already, and it costs milliseconds. Where there is no fork,
    `read` is called here.

    Raises:
        UserError: What `read` raises, or the process died.
    """
    if not hasattr(os, "fork"):
        return read()
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        _answer(writer, read)
    os.close(writer)
    try:
        with os.fdopen(reader, "rb") as pipe:
            head, body = pipe.readline(), pipe.read()
    finally:
        _, status = os.waitpid(child, 0)
    if os.WIFSIGNALED(status):
        name = signal.Signals(os.WTERMSIG(status)).name
        raise UserError(f"{path}: not a readable {kind} (its library died of it: {name}); the file is damaged")
    if os.WEXITSTATUS(status):
        raise UserError(f"{path}: not a readable {kind} (reading it failed; a traceback is above)")
    answer = json.loads(head)
    if "error" in answer:
        raise UserError(answer["error"])
    return np.frombuffer(body, np.dtype(answer["dtype"])).reshape(answer["shape"]).copy()


def _answer(writer: int, read: Callable[[], NDArray[Any]]) -> None:
    """Write a line that says what follows, and the array's bytes; the process ends here, whatever happens."""
    code = 1
    try:
        with os.fdopen(writer, "wb") as pipe:
            try:
                array = np.ascontiguousarray(read())
            except UserError as error:
                pipe.write(json.dumps({"error": str(error)}).encode() + b"\n")
            else:
                pipe.write(json.dumps({"dtype": array.dtype.str, "shape": array.shape}).encode() + b"\n")
                pipe.write(array.tobytes())
        code = 0
    except Exception:  # noqa: BLE001 - a mistake of ours, or no memory: said here, since the process ends without a word
        traceback.print_exc()
    finally:
        os._exit(code)
