import json

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jaka_ros_driver.errors import FramingError
from jaka_ros_driver.simulation.server.request_parser import (
    INCOMPLETE_REQUEST_LIMIT_S,
    MAX_DEPTH,
    MAX_REQUEST_BYTES,
    SKIP_LIMIT_S,
    RequestParser,
)

BAD = FramingError


def parse(*chunks):
    """Return the outcome, errors as the class alone, and the bytes that still wait."""
    parser = RequestParser()
    items = [item for chunk in chunks for item in parser.feed(chunk, 0.0)]
    return [type(item) if isinstance(item, BAD) else item for item in items], parser.pending


def one_by_one(data):
    return parse(*(data[n:n + 1] for n in range(len(data))))


CASES = [
    (b'{"cmdName":"a"}', [{"cmdName": "a"}]),
    (b'{"a": 1}{"b": 2}', [{"a": 1}, {"b": 2}]),
    (b'\r\n{"a": 1}\r\n{"b": 2}\n', [{"a": 1}, {"b": 2}]),
    (b'{"a": 1}\r\n\x00', [{"a": 1}]),
    (b'{}', [{}]),
    (b' { "a" : [ ] , "b" : { } , "c" : [ 1 , -0.5e-3 , true , false , null ] } ',
     [{"a": [], "b": {}, "c": [1, -0.0005, True, False, None]}]),
    (b'{"s": "a\\"}{\\\\ \\u00e9"}', [{"s": 'a"}{\\ é'}]),
    ('{"s": "é"}'.encode(), [{"s": "é"}]),
    (b'{"accel":57.29577951308232,"k":5.729577951308233e-08,"v":0.50}',
     [{"accel": 57.29577951308232, "k": 5.729577951308233e-08, "v": 0.5}]),
    (b'{"a": 1E5, "b": 1e+05, "c": -0, "d": 0.0}', [{"a": 1e5, "b": 1e5, "c": 0, "d": 0.0}]),
    # what can never be JSON is one error, and what comes after it counts
    (b'nan', [BAD]),
    (b'nan\ninf\n{"a": 1}', [BAD, BAD, {"a": 1}]),
    (b'hello world {"a": 1} rest', [BAD, {"a": 1}, BAD]),
    (b'{"cmdName":"joint_move","jointPosition":[nan,0.0],"relFlag":0}{"a": 1}', [BAD, {"a": 1}]),
    (b'{"a": inf}{"b": -inf}{"c": NaN}{"d": Infinity}{"e": 1}', [BAD, BAD, BAD, BAD, {"e": 1}]),
    (b"{'cmdName': 'power_on'}", [BAD]),
    (b'{"a": 01}', [BAD]), (b'{"a": 1.}', [BAD]), (b'{"a": .5}', [BAD]), (b'{"a": +1}', [BAD]), (b'{"a": 1e}', [BAD]),
    (b'{"a": tru}', [BAD]), (b'{"a": True}', [BAD]), (b'{"a" 1}', [BAD]), (b'{"a": 1 "b": 2}', [BAD]),
    (b'{"a": 1,}', [BAD]), (b'{"a": [1,]}', [BAD]), (b'{"a": [,1]}', [BAD]), (b'{,}', [BAD]), (b'{a: 1}', [BAD]),
    (b'{"a": "\n"}', [BAD]), (b'{"a": "\\x"}', [BAD]), (b'{"a": "\\u12g4"}', [BAD]), (b'{"a": "\xff"}', [BAD]),
    (b'{"a": 1]', [BAD]), (b'{"a": [1}', [BAD]), (b'}', [BAD]), (b']', [BAD]), (b'{{{{', [BAD]),
    (b'{{{{ {"cmdName": "z"}', [BAD, {"cmdName": "z"}]),
    (b'{"cmdName": "x" {"cmdName": "stop_program"}', [BAD, {"cmdName": "stop_program"}]),
    (b'{"cmdName": "x"]{"cmdName": "stop_program"}', [BAD, {"cmdName": "stop_program"}]),
    (b'[1, 2, 3]', [BAD]), (b'"text"', [BAD]), (b'12', [BAD]), (b'true', [BAD]),
    (b'{"cmdName": "x, "y": "z{"cmdName": "stop_program"}', [BAD, {"cmdName": "stop_program"}]),
    (b'{"a": nan, "b": "x{", "c": {"cmdName": "power_on"}}{"a": 1}', [BAD, {"a": 1}]),
    (b'{"a": "' + b"x" * MAX_REQUEST_BYTES + b'{ "cmdName": "get_version"}', [BAD, {"cmdName": "get_version"}]),
    # what stands inside something that is no request is none either
    (b'[{"cmdName": "power_on"}]{"a": 1}', [BAD, {"a": 1}]),
    (b'{"x": nan, "y": {"cmdName": "power_on"}}{"a": 1}', [BAD, {"a": 1}]),
    (b'{"x": [nan, {"cmdName": "power_on"}, "}"]}{"a": 1}', [BAD, {"a": 1}]),
    (b'{"a": ' + b"[" * MAX_DEPTH + b"]" * MAX_DEPTH + b'}{"a": 1}', [BAD, {"a": 1}]),
    (b'{"a": ' + b"[" * 100000, [BAD]),
    (b'{"a": ' * MAX_DEPTH + b'{"cmdName": "power_on"}' + b"}" * MAX_DEPTH + b'{"a": 1}', [BAD, {"a": 1}]),
    (b'{"a": "' + b"x" * MAX_REQUEST_BYTES + b'"}{"a": 1}', [BAD, {"a": 1}]),
    (b'{"a": ' + b"1" * MAX_REQUEST_BYTES + b'}{"a": 1}', [BAD, {"a": 1}]),
]


@pytest.mark.parametrize("data, expected", CASES, ids=[repr(data[:40]) for data, _ in CASES])
def test_table(data, expected):
    assert parse(data)[0] == expected


@pytest.mark.parametrize("data", [data for data, _ in CASES if len(data) < 1000], ids=repr)
def test_splitting_changes_nothing(data):
    whole = parse(data)
    assert one_by_one(data) == whole
    for cut in range(1, len(data)):
        assert parse(data[:cut], data[cut:]) == whole


@pytest.mark.parametrize("beginning", [
    b'{', b'{"', b'{"cmdName', b'{"cmdName"', b'{"cmdName":', b'{"a": t', b'{"a": -', b'{"a": 1', b'{"a": 1.',
    b'{"a": 1e', b'{"a": 1e+', b'{"a": "\\', b'{"a": "\\u00', b'{"a": [', b'{"a": [1', b'{"a": [1,', b'{"a": 1}{'],
                         ids=repr)
def test_what_may_become_json_is_waited_for_and_then_given_up(beginning):
    parser = RequestParser()
    assert not any(isinstance(item, BAD) for item in parser.feed(beginning, 100.0))
    assert parser.pending and parser.next_deadline() == 100.0 + INCOMPLETE_REQUEST_LIMIT_S
    assert parser.expire(100.0 + INCOMPLETE_REQUEST_LIMIT_S - 0.01) == []
    items = parser.expire(100.0 + INCOMPLETE_REQUEST_LIMIT_S)
    assert [type(item) for item in items] == [BAD] and parser.pending == 0 and parser.next_deadline() is None
    assert parser.feed(b'{"a": 1}', 200.0) == [{"a": 1}]


@pytest.mark.parametrize("request_, where_a_value_may_come", [
    (b'{"cmdName": "joint_move", "s": "\\u00e9\\\\x", "jointPosition": [0,-1.5e-3], "relFlag": 0}',
     (b":", b": ", b"[", b"[0,")),
    (b'{"a": {"b": ["c","d"]}}', (b":", b": ", b"[", b'["c",'))])
def test_a_request_that_is_cut_does_not_hide_the_next_one(request_, where_a_value_may_come):
    following = b'{"cmdName": "stop_program", "id": 7}'
    for cut in range(1, len(request_)):
        if not request_[:cut].endswith(where_a_value_may_come):
            items, pending = parse(request_[:cut] + following)
            assert items == [BAD, json.loads(following)] and not pending, request_[:cut]
            assert one_by_one(request_[:cut] + following) == (items, pending)


def test_rest_of_a_bad_document_is_expected_for_a_moment_only():
    parser = RequestParser()
    assert len(parser.feed(b'{"a": nan, "b": [', 1.0)) == 1
    assert parser.feed(b'{"cmdName": "x"}', 1.0 + SKIP_LIMIT_S / 2) == []
    parser = RequestParser()
    assert len(parser.feed(b'{"a": nan, "b": [', 1.0)) == 1
    assert parser.feed(b'{"cmdName": "x"}', 1.0 + SKIP_LIMIT_S) == [{"cmdName": "x"}]


def test_memory_is_bounded():
    parser = RequestParser()
    for _ in range(1 << 6):
        parser.feed(b'{"a": "' + b"x" * 4096, 0.0)
        assert parser.pending <= MAX_REQUEST_BYTES


TEXTS = st.text(st.characters(exclude_categories=["Cs"]), max_size=6)
JSON_VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | TEXTS,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(TEXTS, inner, max_size=4), max_leaves=8)
REQUESTS = st.lists(st.dictionaries(TEXTS, JSON_VALUES, max_size=4), min_size=1, max_size=4)


def cut(data, draw):
    cuts = sorted(draw(st.lists(st.integers(0, len(data)), max_size=6)))
    return [data[start:end] for start, end in zip([0, *cuts], [*cuts, len(data)])]


@settings(max_examples=100)
@given(st.data(), REQUESTS, st.sampled_from([b"", b"\n", b"\r\n", b" \x00"]), st.booleans())
def test_every_json_object_is_understood_however_it_is_cut(data, requests, delimiter, ascii_only):
    wire = b"".join(json.dumps(request, ensure_ascii=ascii_only).encode("utf-8") + delimiter
                    for request in requests)
    assert parse(*cut(wire, data.draw)) == (requests, 0)


@settings(max_examples=200)
@given(st.data(), st.one_of(
    st.binary(max_size=60),
    st.text(alphabet='{}[]":,\\ntrue0.e-1 \n', max_size=60).map(str.encode)))
def test_no_bytes_break_it_and_cuts_never_change_the_outcome(data, wire):
    whole = parse(wire)
    assert parse(*cut(wire, data.draw)) == whole == one_by_one(wire)
    for item in whole[0]:
        assert item is BAD or isinstance(item, dict)
