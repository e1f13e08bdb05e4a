"""Streams in the audit log: a line at their begin, one at their end, and one when refusals begin or end."""
import pytest

from jaka_ros_driver.audit.streams import MOST_STREAMS, QUIET_S, Streams


class Bench:
    def __init__(self):
        self.now, self.lines = 10.0, []
        self.streams = Streams(lambda kind, fields: self.lines.append(dict(fields, kind=kind)), lambda: self.now)

    def note(self, key="a", refusal="", count=1):
        for _ in range(count):
            self.streams.note(key, lambda: {"what": "~jog_twist", "node": key, "arguments": {"x": 1}}, refusal)
            self.now += 0.008

    def states(self):
        return [line["state"] for line in self.lines]


@pytest.fixture
def bench():
    return Bench()


def test_a_stream_is_two_lines_however_many_messages_it_has(bench):
    bench.note(count=1000)
    bench.streams.end_quiet()
    assert bench.states() == ["begins"]
    bench.now += QUIET_S
    bench.streams.end_quiet()
    first, last = bench.lines
    assert first["arguments"] == {"x": 1} and first["ok"] and first["node"] == "a"
    assert (last["state"], last["messages"], last["refused"], last["node"]) == ("has ended", 1000, 0, "a")
    assert last["seconds"] == pytest.approx(7.992) and "arguments" not in last


def test_each_publisher_has_its_own(bench):
    bench.note("a")
    bench.note("b")
    bench.streams.end_quiet(0.0)
    assert sorted(line["node"] for line in bench.lines) == ["a", "a", "b", "b"]


def test_the_first_refusal_and_the_first_message_that_is_taken_have_a_line(bench):
    bench.note(refusal="not enabled", count=50)
    bench.note(count=50)
    bench.note(refusal="too far", count=50)
    bench.streams.end_quiet(0.0)
    assert bench.states() == ["begins", "a message is taken", "has ended"]
    assert not bench.lines[0]["ok"] and bench.lines[0]["message"] == "not enabled"
    assert bench.lines[-1]["refused"] == 100 and bench.lines[-1]["last_refusal"] == "too far"
    bench.lines.clear()
    bench.note()
    bench.note(refusal="stale", count=3)
    assert bench.states() == ["begins", "a message is refused"] and bench.lines[1]["message"] == "stale"


def test_names_without_end_cost_no_memory_without_end(bench):
    for number in range(3 * MOST_STREAMS):
        bench.note("node %d" % number)
    assert len(bench.streams._streams) == MOST_STREAMS
    assert bench.states().count("has ended") == 2 * MOST_STREAMS
