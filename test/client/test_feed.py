"""The status feed under damage: ten thousand damaged frames among good ones change nothing but a counter."""
import math
import random

import pytest

from jaka_ros_driver.client.core.feed import Feed
from jaka_ros_driver.protocol import steady_arrays
from jaka_ros_driver.protocol.status import encode_frame

DAMAGED = 10000
FIELDS = {"joint_actual_position": [0.0, 90.0, -90.0, 90.0, 90.0, 0.0], "joint_position": [0.0] * 6,
          "actual_position": [400.0, 100.0, 300.0, 180.0, 0.0, 0.0], "powered_on": 1, "enabled": True, "inpos": True,
          "emergency_stop": 0, "protective_stop": 0, "errcode": "0x0", "rapidrate": 1.0, "din": [0] * 64}


def frame_of(angle):
    return encode_frame(dict(FIELDS, joint_actual_position=[angle] + FIELDS["joint_actual_position"][1:]))


def without_its_tail(chance, frame):
    return frame[:chance.randrange(1, len(frame))]


def without_its_head(chance, frame):
    return frame[chance.randrange(8, len(frame)):]


def with_another_length(chance, frame):
    wrong = chance.choice((0, 7, len(frame) - 3, 60000))
    return frame.replace(b'"len": %d' % len(frame), b'"len": %d' % wrong, 1)


def overwritten(chance, frame):
    start = chance.randrange(12, len(frame) - 40)
    return frame[:start] + bytes(chance.randrange(256) for _ in range(30)) + frame[start + 30:]


def replaced_by_noise(chance, frame):
    return bytes(chance.randrange(256) for _ in range(200))


def with_a_value_that_cannot_be(chance, frame):
    return encode_frame(dict(FIELDS, **{chance.choice(("joint_actual_position", "inpos", "enabled", "rapidrate")):
                                        chance.choice(("x", {}, [1], 10 ** 400))}))


DAMAGES = (without_its_tail, without_its_head, with_another_length, overwritten, replaced_by_noise,
           with_a_value_that_cannot_be)


def test_damaged_frames_change_nothing_but_a_counter():
    chance = random.Random(3)
    genuine = [index / 100.0 for index in range(DAMAGED // 4)]
    pieces = []
    for angle in genuine:
        good = frame_of(angle)
        pieces += [chance.choice(DAMAGES)(chance, good) for _ in range(4)] + [good]
    pieces += [frame_of(300.0)] * 100
    seen = []
    feed = Feed(0.008)
    feed.open(0.0)
    for index, piece in enumerate(pieces):
        seen += [state for state, _ in feed.received(piece, 0.008 * index)]
    shown = [[round(math.degrees(angle), 6) for angle in state.joint_position] for state in seen]
    assert {joints[0] for joints in shown} <= {*genuine, 300.0}
    assert all(joints[1:] == FIELDS["joint_actual_position"][1:] for joints in shown)
    assert all(state.is_enabled and state.is_in_position and not state.emergency_stop for state in seen)
    assert len(seen) > 0.8 * len(genuine), "good frames were lost with the damaged ones"
    times = [state.received_at for state in seen]
    assert all(a < b for a, b in zip(times, times[1:]))
    assert feed.health(0.0, 1.0).damaged > 0.3 * DAMAGED


def test_terminals_that_have_not_changed_are_not_parsed_again_on_any_connection(monkeypatch):
    parsed, parse, frame = [], steady_arrays.parse_object, encode_frame(dict(FIELDS, din=[0] * 1000, netState=1))
    monkeypatch.setattr(steady_arrays, "parse_object", lambda text: parsed.append(len(text)) or parse(text))
    feed = Feed(0.008)
    for opened_at in (1.0, 5.0):
        feed.open(opened_at)
        del parsed[:]
        for number in range(1, 11):
            feed.received(frame, opened_at + 0.008 * number)
            assert feed.state.io.digital_inputs[0] == (0,) * 1000
        assert len([size for size in parsed if size > 1000]) in (1, 2, 3), parsed


def fed(*pieces, period=0.008):
    """Receive pieces and return (angle in deg, is new) of each frame; a piece is (time, angles that arrive at it)."""
    feed = Feed(period)
    feed.open(0.0)
    return [(round(math.degrees(state.joint_position[0])), is_new) for now, angles in pieces
            for state, is_new in feed.received(b"".join(map(frame_of, angles)), now)]


def test_a_steady_feed_is_new_frame_by_frame():
    assert fed(*[(0.008 * n, [n]) for n in range(1, 20)]) == [(n, True) for n in range(1, 20)]


@pytest.mark.parametrize("period", [0.03, 0.1, 0.4])
def test_a_slow_feed_is_new_from_its_third_frame_on_at_the_latest(period):
    told = fed(*[(period * n, [n]) for n in range(1, 20)])
    assert all(is_new for _, is_new in told[2:]) and told[0][1] is (period < 0.15)


def test_after_a_silence_what_has_piled_up_is_old_news_until_the_rhythm_is_back():
    steady = [(0.008 * n, [n]) for n in range(1, 10)]
    burst = [(0.5, [10]), (0.5002, [11, 12, 13]), (0.501, [14]), (0.5012, [15, 16])]
    after = [(0.508, [17]), (0.516, [18]), (0.524, [19])]
    assert fed(*steady, *burst, *after)[9:] == [(n, False) for n in range(10, 18)] + [(18, True), (19, True)]


def test_what_piled_up_behind_a_new_connection_is_old_news_until_the_rhythm_is_there():
    told = fed((0.4, [1, 2, 3, 4]), (0.4002, [5]), (0.408, [6]), (0.416, [7]), (0.424, [8]))
    assert told == [(n, False) for n in range(1, 7)] + [(7, True), (8, True)]


def test_the_first_frame_of_a_link_that_was_held_up_beside_the_reader_is_old_news():
    # nobody reads for 0.5 s, the link stops in the middle of it, and its backlog comes in two pieces
    feed = Feed(0.03)
    feed.open(0.0)
    for n in range(1, 10):
        feed.received(frame_of(n), 0.03 * n)
    feed.held_up()
    pieces = [(0.77, range(10, 20)), (0.84, [20]), (0.845, [21, 22, 23]), (0.87, [24]), (0.9, [25])]
    told = [is_new for now, frames in pieces for _, is_new in feed.received(b"".join(map(frame_of, frames)), now)]
    assert told[-5:] == [False, False, False, False, True] and not any(told[:-1])


def test_of_frames_in_one_piece_the_newest_five_are_new():
    told = fed(*[(0.008 * n, [n]) for n in range(1, 6)], (0.08, list(range(6, 14))))
    assert [is_new for _, is_new in told[5:]] == [False] * 3 + [True] * 5


@pytest.mark.parametrize("came, is_new", [(37, True), (33, True), (28, False), (1, False)])
def test_after_a_pause_the_newest_is_new_where_all_that_were_made_have_come(came, is_new):
    steady = [(0.008 * n, [n]) for n in range(1, 10)]
    told = fed(*steady, (0.072 + 0.3, list(range(10, 10 + came))), (0.072 + 0.308, [99]))[9:]
    assert [new for _, new in told] == [False] * (came - 1) + [is_new, True]


def test_frames_that_were_missing_before_a_pause_are_missing_after_it():
    # A silence too short to matter, of which only the first frame has come; then a pause of its own.
    steady = [(0.008 * n, [n]) for n in range(1, 10)]
    told = fed(*steady, (0.212, [10]), (0.412, list(range(11, 36))), (0.413, list(range(36, 53))))[9:]
    assert told[0][1] and not any(new for _, new in told[1:])


def test_what_piled_up_while_nobody_read_is_old_news_however_slow_the_feed():
    feed = Feed(0.008)
    feed.open(0.0)
    for n in range(1, 10):
        feed.received(frame_of(n), 0.1 * n)
    feed.held_up()
    assert [is_new for _, is_new in feed.received(frame_of(10) + frame_of(11), 1.15)] == [False, False]
    assert [is_new for _, is_new in feed.received(frame_of(12), 1.2)] == [False]
    assert [is_new for _, is_new in feed.received(frame_of(13), 1.3)] == [True]


# ---- its report ----

def test_rate_and_jitter_of_a_feed_and_nothing_of_one_that_is_silent():
    feed, now = Feed(0.008), 0.0
    feed.open(now)
    for n in range(1, 202):
        now = 0.008 * n
        feed.received(frame_of(n), now + (0.003 if n in (60, 120) else 0.0))
    health = feed.health(now, 1.0)
    assert health.rate == pytest.approx(125.0, rel=1e-3) and health.jitter == pytest.approx(0.003, abs=1e-5)
    assert (health.frames, health.damaged) == (201, 0) and health.age == pytest.approx(0.0, abs=1e-6)
    assert feed.health(now + 1.1, 1.0).rate == 0.0


def test_a_pause_of_more_than_three_periods_of_a_slow_feed_puts_what_follows_in_doubt():
    for pause, is_new in ((0.25, True), (0.35, False)):
        steady = [(0.1 * n, [n]) for n in range(1, 10)]
        assert fed(*steady, (0.9 + pause, [10]))[-1] == (10, is_new)


def test_frames_that_come_in_two_pieces_one_right_behind_the_other_are_no_faster_feed():
    pairs = [piece for n in range(1, 12) for piece in ((0.2 * n, [2 * n]), (0.2 * n + 0.001, [2 * n + 1]))]
    assert all(is_new for _, is_new in fed(*pairs, period=0.1)[6:])


def test_frames_that_miss_in_short_pauses_are_missed_after_a_long_one():
    steady = [(0.008 * n, [n]) for n in range(1, 10)]
    told = fed(*steady, (0.112, [10]), (0.152, [11]), (0.452, list(range(12, 49))))
    assert told[9:11] == [(10, True), (11, True)] and not any(is_new for _, is_new in told[11:])


class Paced:
    """A feed whose controller has confirmed a period, s, and whose frames come at any other."""

    def __init__(self, period):
        self.feed, self._now = Feed(period), 0.0
        self.feed.open(0.0)
        self.feed.confirmed(period)

    def take(self, interval, count, at_once=1):
        for n in range(count):
            self._now += interval
            self.feed.received(at_once * frame_of(n), self._now)


def test_a_controller_that_is_slower_by_nature_owes_nothing():
    # It confirms 8 ms and sends every 14 ms; one that sends every 10 ms, or has kept to 8 ms, owes what does not come.
    for rhythms, owes in (([0.014], False), ([0.010], True), ([0.008, 0.014], True)):
        paced = Paced(0.008)
        for interval in rhythms:
            paced.take(interval, 300)
        assert (paced.feed.owed > 0.45) is owes


def test_a_rhythm_that_a_witness_has_confirmed_is_the_period_from_then_on_as_far_as_clocks_differ():
    paced = Paced(0.08)
    for interval, count in ((0.1, 101), (0.101, 400)):
        paced.take(interval, count)
        paced.feed.refute_debt()
        assert paced.feed.owed == 0.0


def test_the_first_hundred_frames_tell_no_rhythm():
    paced = Paced(0.008)
    for interval, count in ((0.008, 50), (0.014, 400)):
        paced.take(interval, count)
    assert paced.feed.owed == 0.0


def test_frames_that_come_two_by_two_keep_their_period_too():
    paced = Paced(0.008)
    for period in (0.008, 0.014):
        paced.take(2.0 * period, 150, at_once=2)
    assert paced.feed.owed > 0.45
