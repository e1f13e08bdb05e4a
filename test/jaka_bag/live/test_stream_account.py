"""The account of a stream: its losses, and how they are known."""
import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from jaka_bag.live.stream_account import PublisherStream, drops_as_metadata, drops_by_topic, starts_with_header
from jaka_bag.messages.connection import Connection

WITH_HEADER = "std_msgs/Header header\nfloat64 x\n" + "=" * 80 + "\nMSG: std_msgs/Header\nuint32 seq\ntime stamp\n" \
    "string frame_id\n"


def stream(definition=WITH_HEADER, topic="/a", callerid="/n", md5sum="m"):
    return PublisherStream(Connection(topic, "pkg/Type", md5sum, definition, callerid), "http://n/")


@pytest.mark.parametrize("definition, expected", [
    (WITH_HEADER, True), (WITH_HEADER.replace("std_msgs/Header header", "Header header"), True), ("float64 x", False),
    (WITH_HEADER.replace("std_msgs/Header header", "float64 y\nstd_msgs/Header header"), False),
    (WITH_HEADER.replace("std_msgs/Header header", "std_msgs/Header[] headers"), False), ("", False), ("???", False)])
def test_only_a_header_in_front_counts(definition, expected):
    assert starts_with_header(Connection("/a", "pkg/Type", "m", definition)) is expected


@pytest.mark.parametrize("numbers, missing", [
    ([1, 2, 3], 0), ([1, 5], 3), ([7], 0), ([3, 3, 3], 0), ([5, 1, 2], 0), ([1, 3, 5], 2), ([2**32 - 1, 0, 1], 0),
    ([2**32 - 2, 1], 2)])
def test_skipped_numbers_are_missing(numbers, missing):
    account = stream()
    for number in numbers:
        account.note_sequence(number)
    assert account.missing == missing


@given(st.sets(st.integers(1, 500), min_size=1))
def test_missing_is_what_lies_between_and_did_not_come(numbers):
    account = stream()
    for number in sorted(numbers):
        account.note_sequence(number)
    assert account.missing == max(numbers) - min(numbers) + 1 - len(numbers)


def test_a_new_link_starts_new_numbers():
    account = stream()
    account.note_sequence(10)
    account.reopen()
    account.note_sequence(1000)
    assert account.missing == 0


def test_the_publishers_count_is_believed_at_the_end_or_when_said_twice():
    account = stream()
    account.received = 10
    account.note_sent(14)
    assert account.undelivered is None  # four may still be on their way
    account.received = 20
    account.note_sent(21)
    assert account.undelivered == 1
    account.note_sent(20, is_final=True)
    assert account.undelivered == 0


def test_losses_of_an_earlier_link_stay():
    account = stream()
    account.received = 10
    account.note_sent(13, is_final=True)
    account.reopen()
    account.received = 30
    account.note_sent(22, is_final=True)
    assert account.undelivered == 3 + 2


def test_a_topic_sums_its_publishers():
    one, two, other = stream(callerid="/one"), stream(callerid="/two", md5sum="n"), stream("float64 x", "/b")
    clock = stream(topic="/clock")
    clock.is_wanted = False
    one.received, one.written, one.missing = 10, 9, 2
    one.unwritten = 1
    two.received, two.written = 5, 5
    two.overflowed = 3
    two.undelivered = 4
    drops = drops_by_topic([one, two, other, clock])
    assert sorted(drops) == ["/a", "/b"]
    a = drops["/a"]
    assert (a.received, a.written, a.missing, a.undelivered, a.overflowed, a.unwritten) == (15, 14, 2, 4, 3, 1)
    assert a.publishers == ("/one", "/two")
    assert a.types == (("pkg/Type", "m"), ("pkg/Type", "n"))
    assert a.is_lossy
    assert a.describe() == ("2 missing by header.seq; 4 sent but not received (publisher's bus statistics); "
                            "3 thrown away, the recorder's buffer was full; 1 received but not written")
    assert (drops["/b"].missing, drops["/b"].undelivered, drops["/b"].is_lossy) == (None, None, False)
    assert drops["/b"].describe() == "nothing lost"
    assert json.loads(drops_as_metadata(drops)["/a"])["overflowed"] == 3
