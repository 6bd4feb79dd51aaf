"""Tables as JSON: a list of objects, one per method and protocol, every figure in full."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any


def json_table(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return the rows as `summarise` gives them; null is a figure that there is not."""
    return json.dumps(list(rows), indent=1, ensure_ascii=False, allow_nan=False)
