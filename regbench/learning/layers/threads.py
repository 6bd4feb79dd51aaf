"""Compiled loops run on as many threads as torch does."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numba
import torch


@contextmanager
def as_many_as_torch() -> Iterator[None]:
    """Give numba's parallel loops torch's number of threads, and both their own numbers back afterwards."""
    threads = torch.get_num_threads()
    most = numba.config.NUMBA_NUM_THREADS  # type: ignore[attr-defined]  # set when numba is imported
    before = numba.get_num_threads()
    numba.set_num_threads(min(threads, most))
    try:
        yield
    finally:
        numba.set_num_threads(before)
        if torch.get_num_threads() != threads:  # where numba's threads are OpenMP's, torch's number is numba's too
            torch.set_num_threads(threads)
