"""Status frames parsed with the arrays kept that the frames before had, too."""
import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from jaka_ros_driver.errors import FramingError
from jaka_ros_driver.protocol.framing import FrameStream, parse_object
from jaka_ros_driver.protocol.status import encode_frame
from jaka_ros_driver.protocol.steady_arrays import SteadyArrays

LONG = b'"din": [%s], ' % b", ".join([b"0"] * 144)
OTHER = b'"ain": [%s], ' % b", ".join([b"0.5"] * 64)


def outcome(parse, text):
    try:
        return parse(text)
    except FramingError:
        return "damage"


def texts_alike(begin=b'{"a": 1, ', between=b"", rest=b'"b": 2}'):
    return begin + LONG + between + OTHER + rest


@given(st.lists(st.tuples(*[st.lists(st.sampled_from([0, 1, -2.5e3]), min_size=100, max_size=100) | st.just([0] * 200)
                            for _ in range(3)], st.integers()), max_size=6))
def test_what_the_frames_before_had_changes_nothing(contents):
    parser = SteadyArrays()
    for arrays in contents:
        text = encode_frame(dict(zip(("din", "dout", "ain", "joints"), arrays)))
        assert parser.parse(text) == parse_object(text)


@pytest.mark.parametrize("text", [
    texts_alike(rest=b'"b": 3}'), texts_alike(begin=b'{"din": [7], '), texts_alike(rest=b'"din": [7]}'),
    texts_alike(begin=b'{"inner": {', rest=b'"b": 2}}'), texts_alike(begin=b'{"a\\'),
    texts_alike(begin=b'{"list": [{', rest=b'"b": 2}]}'), texts_alike(begin=b'{"\\u0000": 0, '),
    texts_alike(begin=b'{"\\u0000": 1, "inner": {', rest=b'"b": 2}}'), texts_alike(rest=b'"b": }'),
    texts_alike(rest=b"}"), texts_alike(begin=b'{"a": ['), texts_alike(begin=b"["), texts_alike(begin=b""),
    texts_alike(between=b'"c": 1, '), texts_alike() + b"{}", texts_alike()[:-1], LONG, b"", b"{}",
    json.dumps({"errmsg": texts_alike().decode()}).encode()])
def test_a_known_run_is_taken_only_where_it_stands_among_the_frames_own_fields(text):
    parser = SteadyArrays()
    for _ in range(2):
        parser.parse(texts_alike())
    assert parser._run
    for _ in range(3):
        assert outcome(parser.parse, text) == outcome(parse_object, text)


def test_only_arrays_that_have_changed_are_parsed_anew():
    stream, frames = FrameStream(parse=SteadyArrays().parse), []
    for number in range(5):
        noise = [number + 0.1] * 64
        frames += stream.feed(encode_frame({"n": number, "din": [0] * 144, "dout": [1] * 144, "ain": noise, "e": 0}))
        assert frames[-1]["n"] == number and frames[-1]["ain"] == noise
    for field in ("din", "dout"):
        assert frames[0][field] == frames[4][field] and frames[3][field] is frames[4][field]


def test_a_run_too_short_to_be_worth_it_is_not_kept():
    parser, text = SteadyArrays(), b'{"din": [0, 0], "b": 1}'
    frames = [parser.parse(text) for _ in range(4)]
    assert frames == 4 * [{"din": [0, 0], "b": 1}] and frames[2]["din"] is not frames[3]["din"]
