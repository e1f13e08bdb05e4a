"""A wire log as a recorded session: pieces at their times, replies by name and number."""
import json
import time

import pytest

from jaka_ros_driver.wire.log import TrueJoints, WireEvent
from jaka_ros_driver.wire.recorded_session import (
    Piece,
    RecordedReply,
    RecordedSessionError,
    Replies,
    cut_objects,
    recorded_session,
)


def event(seconds, port, connection, what, data=b""):
    return WireEvent(int(seconds * 1e9), port, connection, what, data)


def ask(seconds, name, connection=2):
    return event(seconds, "command", connection, "in", json.dumps({"cmdName": name}).encode())


def tell(seconds, name, value, connection=2):
    return event(seconds, "command", connection, "out", b'{"cmdName":"%s","v":%d}\n' % (name.encode(), value))


def test_status_bytes_keep_their_times_whatever_they_are():
    session = recorded_session([event(5.0, "status", 1, "open"), event(5.5, "status", 1, "out", b"\x00half a fr"),
                               event(5.6, "status", 1, "out", b"ame"), event(6.0, "status", 1, "reset")])
    (only,) = session.connections["status"]
    assert [(round(piece.at, 6), piece.data) for piece in only.pieces] == [(0.5, b"\x00half a fr"), (0.6, b"ame")]
    assert (only.opened, only.ended, only.how) == (0.0, pytest.approx(1.0), "reset")
    assert session.duration == pytest.approx(1.0)


def test_the_nth_reply_of_a_name_answers_the_nth_request_of_that_name():
    session = recorded_session([event(0.0, "command", 2, "open"), ask(1.0, "a"), ask(1.1, "b"), ask(1.2, "a"),
                               tell(1.3, "b", 1), tell(1.4, "a", 2), tell(1.6, "a", 3)])
    first, second = session.replies.next("a"), session.replies.next("a")
    assert (first.after, first.data) == (pytest.approx(0.4), b'{"cmdName":"a","v":2}\n')
    assert (second.after, second.data) == (pytest.approx(0.4), b'{"cmdName":"a","v":3}\n')
    assert session.replies.next("b").after == pytest.approx(0.2)
    assert session.replies.answered == 3


def test_a_request_more_often_than_recorded_gets_the_last_reply_again_and_an_unknown_one_none():
    session = recorded_session([event(0.0, "command", 2, "open"), ask(1.0, "a"), tell(1.1, "a", 7)])
    assert session.replies.next("a") == session.replies.next("a")
    assert session.replies.next("zzz") is None
    assert (session.replies.answered, session.replies.repeated, session.replies.unanswered) == (1, 1, ["zzz"])


def test_a_reply_without_a_name_answers_the_oldest_open_request():
    session = recorded_session([event(0.0, "command", 2, "open"), ask(1.0, "a"), ask(1.1, "b"), tell(1.2, "b", 1),
                               event(1.3, "command", 2, "out", b'{"errorCode":"1"}')])
    assert session.replies.next("a").data == b'{"errorCode":"1"}'


def test_replies_go_on_over_a_reconnect():
    session = recorded_session([event(0.0, "command", 2, "open"), ask(1.0, "a"), tell(1.1, "a", 1),
                               event(2.0, "command", 2, "close"), event(3.0, "command", 5, "open"), ask(3.1, "a", 5),
                               tell(3.3, "a", 2, 5)])
    assert session.replies.next("a").data.endswith(b"1}\n")
    assert session.replies.next("a").data.endswith(b"2}\n")
    assert [one.opened for one in session.connections["command"]] == pytest.approx([0.0, 3.0])


def test_objects_are_cut_at_any_piece_boundary_with_all_bytes_kept():
    raw = b' {"a": 1}\n#garbage{{"b": {"c": "}"}}{"d": 3}'
    for cut in range(len(raw) + 1):
        found = cut_objects([Piece(1.0, raw[:cut]), Piece(2.0, raw[cut:])])
        assert [value for _, _, value in found] == [{"a": 1}, {"b": {"c": "}"}}, {"d": 3}]
        assert b"".join(data for _, data, _ in found) == raw


def test_a_log_without_connections_is_refused():
    with pytest.raises(RecordedSessionError, match="no connection"):
        recorded_session([TrueJoints(0, 0.0, (0.0,) * 6)])


def test_questions_about_the_present_are_not_answered_from_another_moment():
    # The driver would take the feed for old: it shows other joints than the answer.
    replies = Replies()
    for at, text in ((1.0, b"off"), (5.0, b"on")):
        replies.add("get_joint_pos", RecordedReply(0.0, b"then"), at)
        replies.add("get_robot_state", RecordedReply(0.0, text), at)
    assert b'"errorCode": "1"' in replies.next("get_joint_pos", 1.0).data
    assert [replies.next("get_robot_state", at).data for at in (0.0, 4.9, 5.1, 5.2)] == [b"off", b"off", b"on", b"on"]
    assert not replies.unanswered


@pytest.mark.parametrize("damage", [b'{"a":' * 3000, b'{"a":' * 96000, b'{"":1,' * 80000, b'{"a":"' + b"{" * 80000,
                                    b'{"a":[1,' * 60000], ids=["deep", "deeper", "many", "a long text", "lists"])
def test_damage_of_any_kind_is_cut_in_a_moment_and_what_follows_it_is_found(damage):
    reply = b'{"cmdName":"x","errorCode":"0"}\n'
    begun = time.process_time()
    found = cut_objects([Piece(0.0, reply), Piece(1.0, damage + b'"}' + b" " * 2000), Piece(2.0, reply)])
    assert time.process_time() - begun < 5.0
    assert found[0] == (0.0, reply, {"cmdName": "x", "errorCode": "0"})
    assert found[-1][0] == 2.0 and found[-1][2] == {"cmdName": "x", "errorCode": "0"}
    assert b"".join([raw for _, raw, _ in found]) == reply + damage + b'"}' + b" " * 2000 + reply


@pytest.mark.parametrize("level", [b'{"a":%s}', b'[%s]', b'{"[{": [%s]}'])
@pytest.mark.parametrize("damage", [b"", b'{"a":[1,' * 300])
def test_an_object_of_many_levels_is_read_behind_damage_too(level, damage):
    raw = b"7"
    for _ in range(40):
        raw = level % raw
    raw = b'{"x": %s, "y": "%s"}' % (raw, b"z" * 1000)
    assert cut_objects([Piece(0.0, damage + raw)])[-1][2] == json.loads(raw)


@pytest.mark.parametrize("size", [*range(480, 540), 4096, 40000, 300000])
def test_an_object_is_read_however_long_it_is(size):
    value = {"cmdName": "x", "text": "\u00e9\\" * (size // 12),
             "numbers": [-1.25e-7, 1234567890123, True, None] * (size // 60)}
    raw = json.dumps(value).encode()
    assert [found for _, _, found in cut_objects([Piece(0.0, b"{" + raw + b"{")])] == [value]
