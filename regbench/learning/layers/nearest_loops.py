"""The selection of the smallest numbers of a row as a compiled loop. Imported when first used."""

from __future__ import annotations

from typing import Any

import numba


@numba.njit(parallel=True, cache=True)
def select_smallest(rows: Any, chosen: Any) -> None:
    """Fill `chosen` (R, k) int64 with where the k smallest of each of (R, M) float32 rows are, in no order.

    A row is read once; a number that is not under the largest of those kept, as most are not, costs one comparison.
    """
    count, length = rows.shape
    k = chosen.shape[1]
    for r in numba.prange(count):
        row, keep = rows[r], chosen[r]
        kept = row[:k].copy()
        for i in range(k):
            keep[i] = i
        worst = kept.argmax()
        limit = kept[worst]
        for j in range(k, length):
            if row[j] < limit:
                kept[worst] = row[j]
                keep[worst] = j
                worst, limit = 0, kept[0]
                for i in range(1, k):
                    if kept[i] > limit:
                        worst, limit = i, kept[i]
