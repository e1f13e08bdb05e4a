"""The status feed under damage: ten thousand damaged frames among good ones change nothing but a counter."""
import contextlib
import math
import random
import socket
import threading

from arm_bench import eventually

from jaka_ros_driver.client.status_monitor import StatusMonitor
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


@contextlib.contextmanager
def serving(pieces):
    """The port of a feed that sends these bytes to whoever connects, and then stays open."""
    with contextlib.closing(socket.create_server(("127.0.0.1", 0))) as listener:
        def serve():
            with contextlib.closing(listener.accept()[0]) as peer:
                for piece in pieces:
                    peer.sendall(piece)
                over.wait(60.0)
        over = threading.Event()
        thread = threading.Thread(target=serve)
        thread.start()
        try:
            yield listener.getsockname()[1]
        finally:
            over.set()
            thread.join()


def test_damaged_frames_change_nothing_but_a_counter():
    chance = random.Random(3)
    genuine = [index / 100.0 for index in range(DAMAGED // 4)]
    pieces = []
    for angle in genuine:
        good = frame_of(angle)
        pieces += [chance.choice(DAMAGES)(chance, good) for _ in range(4)] + [good]
    pieces += [frame_of(300.0)] * 100
    seen = []
    monitor = StatusMonitor(60.0)
    monitor.add_listener(lambda state, _: seen.append(state))
    with serving(pieces) as port:
        monitor.connect("127.0.0.1", port, 5.0, lambda reason: None)
        try:
            assert eventually(lambda: seen and seen[-1].joint_position[0] > 5.0, 120.0)
        finally:
            monitor.close("the test is over")
    shown = [[round(math.degrees(angle), 6) for angle in state.joint_position] for state in seen]
    assert {joints[0] for joints in shown} <= {*genuine, 300.0}
    assert all(joints[1:] == FIELDS["joint_actual_position"][1:] for joints in shown)
    assert all(state.is_enabled and state.is_in_position and not state.emergency_stop for state in seen)
    assert len(seen) > 0.8 * len(genuine), "good frames were lost with the damaged ones"
    times = [state.received_at for state in seen]
    assert all(a < b for a, b in zip(times, times[1:]))
    assert monitor.health().damaged > 0.3 * DAMAGED
