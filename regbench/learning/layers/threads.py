"""Compiled loops run on as many threads as torch does."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numba
import torch


@contextmanager
def as_many_as_torch() -> Iterator[None]:
    """Give numba's parallel loops torch's number of threads, and their own number back afterwards."""
    most = numba.config.NUMBA_NUM_THREADS  # type: ignore[attr-defined]  # set when numba is imported
    before = numba.get_num_threads()
    numba.set_num_threads(min(torch.get_num_threads(), most))
    try:
        yield
    finally:
        numba.set_num_threads(before)
