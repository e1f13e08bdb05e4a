"""A hand on a pad: messages for a velocity jog, at a steady rate and with chosen faults; also an executable, to be
killed.

As an executable it takes the driver's name, and prints each message's moment on standard output.
"""
import contextlib
import io
import os
import subprocess
import sys
import threading
import time

import rospy
from figures import percentile
from geometry_msgs.msg import TwistStamped
from sensor_msgs.msg import JointState
from waiting import eventually

from jaka_bag.live.names import NodeNames
from jaka_bag.live.publisher import Publisher, frame_of
from jaka_bag.messages.connection import Connection

PERIOD_S = 0.02
SPEED = 0.4
"""Speed of the first joint, rad/s, or about the base's z axis."""
WAIT = 60.0


def joint_message(speed, stamp=None):
    message = JointState(name=["joint_3", "joint_1"], velocity=[0.0, speed])
    message.header.stamp = rospy.Time.now() if stamp is None else stamp
    return message


def twist_message(speed, stamp=None, frame_id="base"):
    message = TwistStamped()
    message.header.stamp, message.header.frame_id = rospy.Time.now() if stamp is None else stamp, frame_id
    message.twist.linear.y = 0.5 * speed
    return message


MESSAGES = {"jog_joints": (JointState, joint_message), "jog_twist": (TwistStamped, twist_message)}


def raw(message):
    """Encode a message as TCPROS sends it."""
    buffer = io.BytesIO()
    message.serialize(buffer)
    return frame_of(buffer.getvalue())


class Pad:
    """A sender in its own thread, as a node of its own, until it is closed.

    Attributes:
        speed: The speed that it asks for.
        make: Makes a message of a speed.
        is_silent: It sends nothing.
        is_frozen: It sends its last message again and again.
        is_stalled: The network holds its messages back; they all come at once when it does so no more.
        sent_at: When the newest message was sent that should count.
    """

    def __init__(self, driver, topic="jog_joints", node="/pad"):
        kind, self.make = MESSAGES[topic]
        self.speed = 0.0
        self.is_silent = self.is_frozen = self.is_stalled = False
        self.sent_at = 0.0
        self._publisher = Publisher(NodeNames(node), str, str)
        self._offer = self._publisher.advertise("%s/%s" % (driver, topic), Connection(
            "%s/%s" % (driver, topic), kind._type, kind._md5sum, kind._full_text), False)
        assert eventually(self._publisher.has_subscribers, WAIT), "the driver does not listen"
        self._last = b""
        self._held = []
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self):
        while not self._ending.wait(PERIOD_S):
            if not self.is_silent:
                self._send()

    def _send(self):
        if self.is_frozen:
            self._publisher.publish(self._offer, self._last)
            return
        self._last = raw(self.make(self.speed))
        if self.is_stalled:
            self._held.append(self._last)
            return
        for frame in self._held:
            self._publisher.publish(self._offer, frame)
        self._held = []
        self.sent_at = time.monotonic()
        self._publisher.publish(self._offer, self._last)

    def close(self):
        self._ending.set()
        self._thread.join()
        self._publisher.close(5.0)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


class PadProcess:
    """A pad in a process of its own that jogs from its start on."""

    def __init__(self, driver, topic="jog_joints"):
        self._process = subprocess.Popen([sys.executable, __file__, driver, topic], stdout=subprocess.PIPE, text=True,
                                         env=dict(os.environ, PYTHONPATH=os.pathsep.join(sys.path)))

    def kill(self):
        """End it with SIGKILL; return when it sent its last message."""
        self._process.kill()
        said, _ = self._process.communicate(timeout=WAIT)
        return float(said.splitlines()[-1])

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self._process.poll() is None:
            self.kill()


def begin(arm, pad, speed=SPEED):
    """Ask for rest first, then for motion, until the arm is seen to move; try again where a busy host ends the jog."""
    def moves():
        pad.speed = 0.0
        time.sleep(0.1)
        pad.speed = speed
        return eventually(arm.simulator.is_moving, 1.0)
    pad.is_silent = False
    assert eventually(moves, WAIT), "it is not jogged"


def rests(arm):
    """Return whether the arm rests, and servo mode is left."""
    return eventually(lambda: not arm.simulator.is_moving() and not arm.simulator.state()["is_servo_active"], WAIT)


# ---- ways of letting go: each returns when the last message came that wanted motion and counted ----

def release(arm, pad):
    """Release the stick: messages of rest follow."""
    since = pad.sent_at
    pad.speed = 0.0
    return since


def release_the_button(arm, pad):
    """Release the enabling button: one message of rest and no more, as from teleop_twist_joy."""
    pad.is_silent = True
    time.sleep(PERIOD_S)
    since, pad.speed = pad.sent_at, 0.0
    pad._send()
    return since


def fall_silent(arm, pad):
    pad.is_silent = True
    time.sleep(PERIOD_S)
    return pad.sent_at


def freeze(arm, pad):
    """Repeat one and the same message."""
    pad.is_frozen = True
    time.sleep(PERIOD_S)
    return pad.sent_at


def go_mad(arm, pad):
    since, make = pad.sent_at, pad.make
    pad.make = lambda speed: make(float("nan"))
    return since


def be_joined(arm, pad):
    """Start a second publisher that wants the same."""
    with Pad(arm.name, next(topic for topic, (_, make) in MESSAGES.items() if make is pad.make), "/other") as other:
        other.speed, since = pad.speed, pad.sent_at
        rests(arm)
    return since


def be_stalled(arm, pad):
    """Hold everything back for 0.5 s in the network, and then deliver it at once."""
    pad.is_stalled = True
    time.sleep(PERIOD_S)
    since = pad.sent_at
    time.sleep(0.5)
    pad.is_stalled = False
    return since


KILLED = "killed"
WAYS = {"release": release, "button": release_the_button, "silence": fall_silent, "frozen": freeze, "nan": go_mad,
        "two publishers": be_joined, "stalled network": be_stalled}


def let_go(arm, way, topic="jog_joints"):
    """Jog, release in this way, and see the arm rest; return when the last counting message came, and when rest was
    seen."""
    if way == KILLED:
        return _be_killed(arm, topic)
    with Pad(arm.name, topic) as pad:
        begin(arm, pad)
        since = WAYS[way](arm, pad)
        assert rests(arm), "it goes on"
        return since, time.monotonic()


def _be_killed(arm, topic):
    with PadProcess(arm.name, topic) as pad:
        assert eventually(arm.simulator.is_moving, WAIT), "it is not jogged"
        time.sleep(0.1)
        since = pad.kill()
        assert rests(arm), "it goes on"
        return since, time.monotonic()


def last_frame_of_motion(verdict, since, until):
    """Return when the last servo frame came in that differs from the one before it."""
    frames = [(at, request["jointPosition"]) for at, request in verdict.received()
              if request["cmdName"] == "servo_j" and since - 1.0 <= at <= until]
    return max([b[0] for a, b in zip(frames, frames[1:]) if a[1] != b[1]], default=since)


def main():
    """Publish rest, then motion for ever, and print each message's moment."""
    rospy.init_node("killed_pad", anonymous=True, disable_signals=True)
    kind, make = MESSAGES[sys.argv[2]]
    publisher = rospy.Publisher("%s/%s" % tuple(sys.argv[1:3]), kind, queue_size=1, tcp_nodelay=True)
    assert eventually(lambda: publisher.get_num_connections() > 0, WAIT)
    count = 0
    with contextlib.suppress(BrokenPipeError):
        while True:
            count += 1
            print(time.monotonic(), flush=True)
            publisher.publish(make(0.0 if count % 200 < 10 else SPEED))
            time.sleep(PERIOD_S)


if __name__ == "__main__":
    main()


def print_rests(moments, verdict):
    """Print a table of how soon frames and arm rest: by way of release, when that was and until when to look."""
    print("way               repeats   frames at rest: p50    max      arm at rest: p50    max   (ms)")
    for way, ends in moments.items():
        wire = [1e3 * (last_frame_of_motion(verdict, since, until) - since) for since, until in ends]
        arm = [1e3 * (verdict.rest_after(since, until) - since) for since, until in ends]
        print("%-18s %6d   %19.0f %6.0f   %16.0f %6.0f" % (
            way, len(ends), percentile(wire, 0.5), max(wire), percentile(arm, 0.5), max(arm)))
