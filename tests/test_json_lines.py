"""Lines of JSON are read as the standard library reads them."""

import json
import math
import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from regbench.json_lines import parse_json


@given(st.lists(st.integers(0, 2**64 - 1).map(lambda bits: struct.unpack("d", struct.pack("Q", bits))[0])))
@settings(max_examples=300)
def test_numbers_of_any_bits_come_back(values):
    finite = [value for value in values if math.isfinite(value)]
    back = parse_json(json.dumps(finite).encode())
    assert struct.pack(f"{len(finite)}d", *back) == struct.pack(f"{len(finite)}d", *finite)


@pytest.mark.parametrize(
    "text",
    [
        "0.1",
        "-0.0",
        "2.2250738585072011e-308",  # the one that hung PHP and Java
        "5e-324",
        "1e-400",
        "1.7976931348623157e308",
        "1e999",
        "-Infinity",
        "9007199254740993.0",
        "0.1000000000000000055511151231257827021181583404541015625",
        '{"a": 1, "a": 2}',
        '"\\ud800"',
        '"\\u0000\\u00e9"',
        "[" * 500 + "]" * 500,
        " [true, null] \n",
        "18446744073709551615",
    ],
)
def test_what_the_standard_library_reads_is_read_alike(text):
    assert repr(parse_json(text.encode())) == repr(json.loads(text))


def test_nan_is_read_as_nan():
    assert math.isnan(parse_json(b'{"a": NaN}')["a"])


@pytest.mark.parametrize(
    "line", [b"", b'{"key": "torn', b"[1,]", b"\xff", b"nonsense", b"[" * 100_000, b'{"a":1}{"b":2}']
)
def test_what_is_not_json_is_a_value_error(line):
    with pytest.raises(ValueError):
        parse_json(line)
