"""Damages bytes, as fuzz.py wants them: bit flips, cuts, splices, huge counts, strange numbers, other JSON values."""

import json
import re

TOKENS = (
    b"nan",
    b"-nan",
    b"inf",
    b"-inf",
    b"1e999",
    b"-1e999",
    b"1e-320",
    b"-1",
    b"0",
    b"-0",
    b"1",
    b"2147483647",
    b"4294967295",
    b"9223372036854775807",
    b"9223372036854775808",
    b"999999999999999999",
    b"99999999999999999999999",
    b"0x10",
    b"1_0",
    b"\x00",
    b"\xff" * 8,
    b"\x7f" * 4,
    b"\x80\x00\x00\x00",
    b"\n",
    b"\r\n",
    b" ",
    b"\t",
    b",",
    b"#",
    b"\xc3\xa9",
    b"\xe2\x80\xa8",
    b"\xed\xa0\x80",
    b"[" * 60,
    b"{",
    b"}",
    b"null",
    b"true",
    b'"',
    b"'",
    b"..",
    b"../../x",
    b"/etc/passwd",
    b"list",
    b"uchar",
    b"float64",
    b"<f8",
    b">f4",
    b"|O",
    b"|V8",
    b"<U4",
    b"(3,",
    b"True",
    b"ascii",
    b"binary_compressed",
)
NUMBERS = re.compile(rb"[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?")
VALUES = (
    None,
    True,
    False,
    0,
    -1,
    1,
    2**31,
    2**63,
    10**30,
    -(10**400),
    0.5,
    -0.0,
    1e308,
    float("nan"),
    float("inf"),
    "",
    "x",
    "nan",
    "ok",
    "\ud800",
    "\u2028",
    "../x",
    [],
    {},
    [[]],
    [None],
    {"a": 1},
    [[1, 2], [3]],
    [[0.0] * 4] * 4,
    [["a"] * 4] * 4,
    [[10**400] * 4] * 4,
    [[float("nan")] * 4] * 4,
    [[True] * 4] * 4,
    "x" * 5000,
)


def damaged(data: bytes, others: list[bytes], random) -> bytes:
    """Return the data after one to four mutations; `others` are what a splice takes its part from."""
    for _ in range(random.choice((1, 1, 1, 2, 3, 4))):
        data = random.choice(MUTATIONS)(data, others, random)
    return data


def _span(data, random, longest=64):
    start = random.randrange(len(data) + 1)
    return start, min(len(data), start + random.choice((1, 2, 4, 8, random.randint(1, longest))))


def _flip(data, others, random):
    if not data:
        return data
    changed, at = bytearray(data), random.randrange(len(data))
    changed[at] ^= 1 << random.randrange(8)
    return bytes(changed)


def _flip_early(data, others, random):
    return _flip(data[:200], others, random) + data[200:]


def _cut_end(data, others, random):
    return data[: random.randrange(len(data) + 1)]


def _remove(data, others, random):
    start, end = _span(data, random)
    return data[:start] + data[end:]


def _repeat(data, others, random):
    start, end = _span(data, random)
    return data[:end] + data[start:end] * random.choice((1, 2, 50)) + data[end:]


def _splice(data, others, random):
    other = random.choice(others)
    return data[: random.randrange(len(data) + 1)] + other[random.randrange(len(other) + 1) :]


def _overwrite(data, others, random):
    token = random.choice(TOKENS)
    at = random.randrange(len(data) + 1)
    return data[:at] + token + data[at + len(token) :]


def _insert(data, others, random):
    at = random.randrange(len(data) + 1)
    return data[:at] + random.choice(TOKENS) + data[at:]


def _number(data, others, random):
    head = data[:4000]
    found = list(NUMBERS.finditer(head))
    if not found:
        return data
    match = random.choice(found[:12] if random.random() < 0.5 else found)
    return data[: match.start()] + random.choice(TOKENS[:19]) + data[match.end() :]


def _integer(data, others, random):
    """Overwrite a binary count."""
    if len(data) < 8:
        return data
    width = random.choice((2, 4, 8))
    value = random.choice(
        (0, 1, 2 ** (8 * width) - 1, 2 ** (8 * width - 1), 2 ** (8 * width - 1) - 1, random.randrange(256))
    )
    at = random.randrange(len(data) - width + 1)
    return data[:at] + value.to_bytes(width, random.choice(("little", "big"))) + data[at + width :]


def _lines(data, others, random):
    lines = data.split(b"\n")
    at, other = random.randrange(len(lines)), random.randrange(len(lines))
    match random.randrange(3):
        case 0:
            lines[at], lines[other] = lines[other], lines[at]
        case 1:
            lines.insert(at, lines[other])
        case _:
            del lines[at]
    return b"\n".join(lines)


def _json(data, others, random):
    """Put another value somewhere into a JSON document, or into one line of JSON lines."""
    lines = [data]
    try:
        json.loads(data)
    except ValueError:
        lines = data.split(b"\n")
    at = random.randrange(len(lines))
    try:
        document = json.loads(lines[at])
    except (ValueError, RecursionError):
        return data
    lines[at] = json.dumps(_changed(document, random)).encode()
    return b"\n".join(lines)


def _changed(node, random):
    if not (isinstance(node, dict | list) and node) or random.random() < 0.15:
        return random.choice(VALUES)
    key = random.choice(list(node) if isinstance(node, dict) else range(len(node)))
    if random.random() < 0.15:
        if isinstance(node, dict):
            return {name: value for name, value in node.items() if name != key}
        return node[:key] + node[key + 1 :]
    changed = dict(node) if isinstance(node, dict) else list(node)
    changed[key] = _changed(node[key], random)
    return changed


MUTATIONS = (
    _flip,
    _flip_early,
    _cut_end,
    _remove,
    _repeat,
    _splice,
    _overwrite,
    _insert,
    _number,
    _number,
    _integer,
    _lines,
    _json,
    _json,
)
