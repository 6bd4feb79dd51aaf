"""What to say of a name that nobody knows."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


def unknown(what: str, name: str, known: Iterable[str], *, of: str = "", listing: str = "") -> str:
    """Return one line: the unknown name, the nearest known one if any, and what there is."""
    names = list(known)
    near = difflib.get_close_matches(name, names, n=1, cutoff=0.5)
    message = f"unknown {what} '{name}'" + (f" of {of}" if of else "")
    if near:
        message += f"; did you mean '{near[0]}'?"
    if listing:
        return f"{message} (see {listing})"
    return f"{message} (there is: {', '.join(names)})" if names else f"{message} (there is none)"
