"""The lines of the audit log and their chain: jaka_bag follows what the log writes, and accepts nothing else."""
import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from jaka_bag.operations import audit_log
from jaka_ros_driver.audit import chain

JSON = st.recursive(st.none() | st.booleans() | st.integers(-2 ** 53, 2 ** 53) | st.floats(allow_nan=False,
                    allow_infinity=False) | st.text(max_size=30), lambda inner: st.lists(inner, max_size=4)
                    | st.dictionaries(st.text(max_size=8), inner, max_size=4), max_leaves=12)
FIELDS = st.dictionaries(st.text(min_size=1, max_size=12).filter(lambda name: name not in ("n", "prev", "crc")), JSON,
                         max_size=6)


@given(FIELDS)
def test_a_line_is_read_as_it_was_written_by_both_sides(fields):
    line = chain.encode(chain.START, fields)
    assert b"\n" not in line and len(line) <= chain.LONGEST_LINE
    for read in (chain.decode(line), audit_log._decode(line)[0]):
        assert read is not None and read.pop("n") == 1 and read.pop("prev") == chain.BEFORE_THE_FIRST
        assert read.pop("crc") and json.dumps(read, sort_keys=True) == json.dumps(fields, sort_keys=True)


@given(FIELDS, st.data())
def test_a_line_with_a_changed_byte_is_no_line(fields, data):
    line = bytearray(chain.encode(chain.START, fields))
    place = data.draw(st.integers(0, len(line) - 1))
    line[place] ^= data.draw(st.integers(1, 255))
    assert chain.decode(bytes(line)) is None and audit_log._decode(bytes(line))[0] is None


def test_the_checksum_is_at_the_end_and_of_all_before_it():
    line = chain.encode(chain.ChainLink(41, "ab" * 32), {"kind": "call"})
    assert line.startswith(b'{"n":42,"prev":"abab') and json.loads(line)["kind"] == "call"
    assert chain.link_of(line, 42).number == 42 and len(chain.link_of(line, 42).sha256) == 64


@pytest.mark.parametrize("size", [chain.LONGEST_LINE, 10 ** 6])
def test_what_would_be_too_long_is_left_out_and_named(size):
    line = chain.encode(chain.START, {"kind": "call", "arguments": "x" * size, "node": "/a"})
    fields = chain.decode(line)
    assert len(line) <= chain.LONGEST_LINE and fields["node"] == "/a" and "arguments" not in fields
    assert fields["left_out"].startswith("arguments: ")


def test_what_json_has_no_word_for_is_an_error():
    with pytest.raises(ValueError):
        chain.encode(chain.START, {"value": float("nan")})


def test_a_text_that_utf8_cannot_hold_is_written_all_the_same():
    assert chain.decode(chain.encode(chain.START, {"text": "half \ud800 of it"}))["text"] == "half ? of it"
