"""LZF, the compression of PCD's binary_compressed: runs of bytes, and copies of what came before."""

from __future__ import annotations

# A copy of three bytes yields 264 at most.
MAX_INFLATION = 88


def decompress(packed: bytes, size: int) -> bytes:
    """Return the `size` bytes that `packed` holds.

    Raises:
        ValueError: The data is broken, or yields another number of bytes.
    """
    content = bytearray()
    at = 0
    try:
        while at < len(packed) and len(content) <= size:
            control = packed[at]
            at += 1
            if control < 32:  # a run of control + 1 bytes, as they are
                content += packed[at : at + control + 1]
                at += control + 1
                continue
            length = control >> 5
            if length == 7:
                length += packed[at]
                at += 1
            start = len(content) - ((control & 31) << 8) - packed[at] - 1
            at += 1
            if start < 0:
                raise ValueError("its compressed data is broken")
            length += 2
            # The copy may run into what it writes: then what is there repeats.
            piece = content[start : start + length]
            content += (piece * (length // len(piece) + 1))[:length]
    except IndexError:
        raise ValueError("its compressed data is truncated") from None
    if len(content) != size:
        raise ValueError(f"its compressed data yields {len(content)} bytes, expected {size}")
    return bytes(content)
