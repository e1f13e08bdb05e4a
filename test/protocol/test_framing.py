"""JSON objects and status frames cut out of byte streams, whole, split, glued and damaged."""
import json
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from jaka_ros_driver.errors import FramingError
from jaka_ros_driver.protocol.framing import (
    MAX_DAMAGE_BYTES,
    FrameStream,
    ObjectStream,
    encode_object,
    parse_object,
)
from jaka_ros_driver.protocol.status import encode_frame

JSON_VALUES = st.recursive(
    st.none() | st.booleans() | st.integers(-10**6, 10**6) | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4), max_leaves=12)
OBJECTS = st.dictionaries(st.text(max_size=8), JSON_VALUES, max_size=5)
FRAME = encode_frame({"errcode": "0x0", "note": 'a "quoted" { brace', "joint_actual_position": [1.5] * 6})


def fed(stream, data, cuts):
    """Return what a stream yields of data that arrives cut at these places."""
    items, last = [], 0
    for cut in sorted(cut % (len(data) + 1) for cut in cuts) + [len(data)]:
        items += stream.feed(data[last:cut])
        last = cut
    return items


def shape(items):
    return ["damage" if isinstance(item, FramingError) else item for item in items]


@given(st.lists(OBJECTS, max_size=6), st.lists(st.integers(0, 10**6), max_size=20),
       st.sampled_from(["", "\n", "\r\n", " ", "\x00"]))
def test_objects_come_out_whole_wherever_they_are_cut(objects, cuts, between):
    data = between.join(json.dumps(o) for o in objects).encode()
    assert fed(ObjectStream(), data, cuts) == objects


@pytest.mark.parametrize("stream", [ObjectStream, FrameStream])
@given(pieces=st.lists(st.one_of(
    st.just(FRAME), st.integers(1, len(FRAME) - 1).map(lambda n: FRAME[:n]), st.binary(max_size=40),
    st.sampled_from([b'{"len": 3, ', b'{"len": 99999999, "a": 1}', b'{"len": 5000, "a": 1}', b"{}", b"NaN", b"\\",
                     b'"'])),
    max_size=8), cuts=st.lists(st.integers(0, 10**6), max_size=20))
def test_splitting_never_changes_the_outcome_of_damaged_streams(stream, pieces, cuts):
    data = b"".join(pieces) + 2 * FRAME
    assert shape(fed(stream(), data, cuts)) == shape(stream().feed(data))


_INNER = encode_frame({"a": 1}).decode()
PIECES = [FRAME, encode_frame({"note": _INNER}), encode_frame({"a": _INNER[:-1]}), FRAME[:-1] + b"]",
          FRAME[:-2] + b"}}", FRAME.replace(b"0x0", b"0x\xff"), encode_frame({"a": 1}).replace(b"1}", b"NaN}"),
          b" " + FRAME, FRAME + b"\n", FRAME[:9], FRAME[9:], b'{"len": 9}', b'{"len": 10}', b'{"len": 11}',
          b'{"len": 20, "a": 1234567}', b'{"len": 30, "a": 1234567}', b"{}", b"x", b"\0"]


@given(st.lists(st.sampled_from(PIECES), max_size=10))
def test_pieces_that_are_one_frame_are_read_as_all_others(pieces):
    stream = FrameStream()
    in_turn = [item for piece in [*pieces, FRAME] for item in stream.feed(piece)]
    assert shape(in_turn) == shape(FrameStream().feed(b"".join([*pieces, FRAME])))
    assert not stream._heads and not stream._whole and not stream._buffer


@given(st.lists(st.one_of(st.just(FRAME), st.binary(max_size=40).filter(lambda b: b"{" not in b)), max_size=8))
def test_whole_frames_survive_garbage_between_them(pieces):
    frames = [item for item in FrameStream().feed(b"".join(pieces)) if not isinstance(item, FramingError)]
    assert len(frames) == pieces.count(FRAME)


def test_a_cut_frame_costs_itself_only():
    for kept in range(len(FRAME)):
        items = FrameStream().feed(FRAME + FRAME[:kept] + FRAME + FRAME)
        assert shape(items).count(json.loads(FRAME)) == 3
        assert shape(items).count("damage") <= 1


@pytest.mark.parametrize("text", [b'{"a": NaN}', b'{"a": Infinity}', b'{"a": -Infinity}', b'{"a": nan}', b"{'a': 1}",
                                  b'{"a": 1,}', b'{"a"}', b'{"a": "\xff"}',
                                  b'{"a": ' + 100000 * b"[" + 100000 * b"]" + b"}", b"[1]", b"7", b"", b"{"])
def test_what_is_not_a_json_object_is_a_framing_error(text):
    with pytest.raises(FramingError):
        parse_object(text)


def test_after_a_bad_object_the_next_one_is_read():
    assert shape(ObjectStream().feed(b'{"a": NaN}{"b": 1}xyz{"c": 2}')) == ["damage", {"b": 1}, "damage", {"c": 2}]


def test_an_object_that_never_ends_is_dropped_and_memory_stays_bounded():
    stream = ObjectStream(max_bytes=1000)
    items = []
    for _ in range(100):
        items += stream.feed(b'{"a": [' + b"1, " * 30)
        assert stream.pending <= 1000
    assert items and all(isinstance(item, FramingError) for item in items)


@pytest.mark.parametrize("length", [0, 3, 65537, 999999999])
def test_an_impossible_len_is_damage_and_the_next_frame_is_read(length):
    items = FrameStream().feed(b'{"len": %d, "a": 1}' % length + FRAME)
    assert shape(items) == ["damage", json.loads(FRAME)]


@pytest.mark.parametrize("length", [0, 65537, 999999999])
def test_an_impossible_len_is_damage_at_once_and_nothing_is_kept_for_it(length):
    stream = FrameStream()
    assert shape(stream.feed(b'{"len": %d, "a": 1' % length)) == ["damage"]
    for _ in range(100):
        assert not stream.feed(b", " + b"1" * 1000)
    assert len(stream._buffer) < 1000


def test_a_frame_with_another_len_than_its_text_is_damage():
    true = b'"len": %d' % len(FRAME)
    for wrong in (len(FRAME) - 1, len(FRAME) + 1, 30):
        items = FrameStream().feed(FRAME.replace(true, b'"len": %d' % wrong) + FRAME)
        assert shape(items) == ["damage", json.loads(FRAME)]


def test_objects_are_written_as_the_controller_writes_them():
    assert encode_object({"a": [1.5, 2], "b": "x"}) == b'{"a": [1.5, 2], "b": "x"}'


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_a_number_that_is_not_finite_is_not_written(value):
    with pytest.raises(FramingError):
        encode_object({"a": value})


FLOODS = [b'{"len": 60017, "}": ', b'{"len": 60000, ', b'{"len": 60000, "a', b'{"len": 60000, "a": 1}',
          b'{"len": 100, "', b'{"len": 3, ', b"{", b"\xff", b'{"len": 60000, "a": ' + b"[1, 2, 3], " * 500]


@pytest.mark.parametrize("piece", [1448, 1 << 16, 1 << 19])
@pytest.mark.parametrize("unit", FLOODS, ids=lambda unit: str(unit[:24]))
def test_a_megabyte_that_is_no_frame_costs_little_and_is_not_read_to_its_end(unit, piece):
    data = (unit * ((1 << 20) // len(unit) + 1))[:1 << 20]
    costs = []
    for _ in range(3):  # on a busy host a process is charged for time that it did not get: the best of three counts
        stream, items, before = FrameStream(), [], time.process_time()
        for start in range(0, len(data), piece):
            items += stream.feed(data[start:start + piece])
        costs.append(time.process_time() - before)
    assert min(costs) < 1.0, "0.05 s on a quiet computer"
    assert stream.is_flooded and shape(items) == ["damage"] and len(stream._buffer) < 1 << 17
    assert not stream.feed(FRAME)


def test_damage_that_a_frame_interrupts_is_no_flood():
    stream, items = FrameStream(), []
    for _ in range(20):
        items += stream.feed(b"#" * (MAX_DAMAGE_BYTES // 2) + FRAME)
    assert shape(items) == ["damage", json.loads(FRAME)] * 20 and not stream.is_flooded
