"""Values that number formats make equal and a message has otherwise: zeros behind texts, flags, arrays of nothing."""
import struct

import pytest
from log_samples import BREAK, START_NS, Sample, connection, text, tool, write

from jaka_bag.compare.comparison import compare_logs

WORDS = connection("/words", "cell/Words", "string one\nstring[] some\n")
GOALS = connection("/goals", "cell/Goals", "GoalID goal_id\n" + BREAK + "MSG: cell/GoalID\nstring id\n")
FLAGS = connection("/flags", "cell/Flags", "bool one\nbool[] some\nbool[2] two\n")
SIGNALS = connection("/signals", "cell/Signals", "None[] some\nPart[] parts\n" + BREAK + "MSG: cell/None\nint32 A=3\n"
                     + BREAK + "MSG: cell/Part\nNone[] inner\n")


def words(one, *some):
    return text(one) + struct.pack("<I", len(some)) + b"".join(map(text, some))


def flags(one=1, some=1, two=1):
    return struct.pack("<BIBBBB", one, 2, some, 0, two, 0)


def numbers(*values):
    return struct.pack("<%dI" % len(values), *values)


@pytest.mark.parametrize("kind, ours, theirs", [
    (WORDS, words("E100", "a"), words("E100\0", "a")), (WORDS, words("a", "E100"), words("a", "E100\0")),
    (WORDS, words("a", "b", "E100\0"), words("a", "b", "E100\0\0")), (WORDS, words("a", ""), words("a", "\0")),
    (WORDS, words("a\0", "b\0"), words("a\0", "b")), (GOALS, text("/cell-1-5.0"), text("/cell-1\0-5.0")),
    (FLAGS, flags(), flags(one=2)), (FLAGS, flags(), flags(some=2)), (FLAGS, flags(), flags(two=2)),
    (SIGNALS, numbers(1, 0), numbers(2, 0)), (SIGNALS, numbers(0, 0), numbers(1, 0)),
    (SIGNALS, numbers(0, 1, 1), numbers(0, 1, 2)), (SIGNALS, numbers(0, 0), numbers(0, 1, 0))],
    ids=range(13))
@pytest.mark.parametrize("share", [1, 2])
def test_what_differs_in_its_bytes_only_is_found(kind, ours, theirs, share, tmp_path):
    def log(name, other):
        return write(tmp_path / name, [Sample(kind, START_NS + i * 20_000_000, ours if i < 200 // share else other)
                                       for i in range(400)])

    golden, again, candidate = log("golden.mcap", ours), log("again.mcap", ours), log("candidate.mcap", theirs)
    assert compare_logs(golden, again).same
    for pair in ((golden, candidate), (candidate, golden)):
        assert {check.topic for check in compare_logs(*pair).differences} == {kind.topic}


def test_frames_whose_names_are_no_text_are_told_apart(tmp_path):
    samples = [tool(i, START_NS + i * 8_000_000, [1.0, 2.0, 3.0, 0.1, 0.2, 0.3]) for i in range(200)]
    ours, theirs = (write(tmp_path / name, [one._replace(data=one.data.replace(b"base", raw)) for one in samples])
                    for name, raw in (("golden.mcap", b"bas\xff"), ("candidate.mcap", b"bas\xfe")))
    (found,) = compare_logs(ours, theirs).differences
    assert "bas\\xff" in found.golden + found.detail and "bas\\xfe" in found.candidate + found.detail
