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
    of_torch = torch.get_num_threads()  # read first: numba's threads begin with the next line
    before = numba.get_num_threads()
    numba.set_num_threads(min(of_torch, most))
    try:
        yield
    finally:
        numba.set_num_threads(before)
        # Where both run on OpenMP, numba's number has just become torch's.
        if torch.get_num_threads() != of_torch:
            torch.set_num_threads(of_torch)
