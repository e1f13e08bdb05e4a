"""The messages that wait for a viewer: in order, bounded, the newest win."""
import struct

from jaka_foxglove.outbox import MAX_ANSWERS, Outbox


def taken(outbox):
    return list(iter(outbox.take, None))


def test_answers_and_messages_leave_in_their_order():
    outbox = Outbox(10000)
    outbox.answer("a")
    outbox.message(1, 5, b"x")
    outbox.message(None, 6)
    outbox.answer(b"b")
    assert taken(outbox) == ["a", b"\x01" + struct.pack("<IQ", 1, 5) + b"x", b"\x02" + struct.pack("<Q", 6), b"b"]
    assert (outbox.sent, outbox.dropped, outbox.size, len(outbox)) == (1, 0, 0, 0)


def test_the_oldest_messages_are_dropped_and_counted_but_no_answer():
    outbox = Outbox(5000)
    outbox.answer("kept")
    for number in range(100):
        outbox.message(1, number, bytes(1000))
    frames = taken(outbox)
    assert frames[0] == "kept" and [struct.unpack_from("<Q", frame, 5)[0] for frame in frames[1:]] == [96, 97, 98, 99]
    assert (outbox.sent, outbox.dropped) == (4, 96)


def test_a_message_that_is_larger_than_the_limit_goes_alone():
    outbox = Outbox(100)
    outbox.message(1, 1, b"small")
    outbox.message(1, 2, bytes(100000))
    assert [len(frame) for frame in taken(outbox)] == [100013] and outbox.dropped == 1


def test_payloads_are_shared_not_copied():
    payload = bytes(1 << 20)
    boxes = [Outbox(1 << 30) for _ in range(100)]
    for outbox in boxes:
        outbox.message(1, 1, payload)
    assert all(outbox._messages[0][1].payload is payload for outbox in boxes)


def test_too_many_answers_are_refused():
    outbox = Outbox(100)
    assert all(outbox.answer("x") for _ in range(MAX_ANSWERS)) and not outbox.answer("x")


def test_messages_are_forgotten_all_or_of_one_subscription():
    outbox = Outbox(10000)
    for subscription in (1, 2, 1):
        outbox.message(subscription, 0, bytes([subscription]))
    outbox.forget_subscription(1)
    assert [frame[-1] for frame in taken(outbox)] == [2] and outbox.dropped == 0 and outbox.size == 0
    outbox.message(1, 0, b"x")
    outbox.forget_messages()
    assert not taken(outbox) and outbox.size == 0
