"""The cuts of a running driver's links, each noticed, survived and judged; times are an outside observer's."""
import math
import random
import time
from pathlib import Path
from typing import Any, Callable, Dict, List, NamedTuple

import rospy
from driver_bench import HOME, MOTIONS, begin
from raw_client import RawClient
from rosgraph_msgs.msg import Log
from sensor_msgs.msg import JointState
from waiting import InBackground, eventually

ENERGISING = {"power": "power_on", "enable": "enable_robot"}
"""Command of each service that energises."""
MOTION_COMMANDS = ("joint_move", "moveL")


def _another_client(simulator):
    with RawClient(simulator.command_port) as client:
        client.send(b'{"cmdName": "get_version"}')
        time.sleep(0.1)


def _lose_a_reply(simulator):
    """Lose a reply that is waited for: nobody waits for those of a servo stream."""
    one = {"command": "is_in_servomove"} if simulator.state()["is_servo_active"] else {}
    simulator.operate("fault", kind="drop", port="command", **one)


class Cut(NamedTuple):
    """A way to cut a link; ``down`` is how long the controller cannot be reached afterwards, s."""

    strike: Callable[[Any], Any]
    down: float = 0.0
    is_silent: bool = False


CUTS: Dict[str, Cut] = {
    "FIN": Cut(lambda sim: sim.operate("close")),
    "FIN of the command port": Cut(lambda sim: sim.operate("close", port="command")),
    "FIN of the status port": Cut(lambda sim: sim.operate("close", port="status")),
    "RST": Cut(lambda sim: sim.operate("reset")),
    "half open": Cut(lambda sim: sim.operate("half_open"), is_silent=True),
    "command port half open": Cut(lambda sim: sim.operate("half_open", port="command"), is_silent=True),
    "status port half open": Cut(lambda sim: sim.operate("half_open", port="status"), is_silent=True),
    "silent for a while": Cut(lambda sim: sim.operate("stall", duration_ms=1500), 1.5, is_silent=True),
    "half a frame": Cut(lambda sim: sim.operate("fault", kind="cut", port="status", bytes=1000)),
    "half a reply": Cut(lambda sim: sim.operate("fault", kind="cut", port="command", bytes=10)),
    "reply lost": Cut(_lose_a_reply, is_silent=True),
    "reboot": Cut(lambda sim: sim.operate("reboot", down=1.0), 1.0),
    "power failure": Cut(lambda sim: sim.operate("reboot", down=1.5, silent=1), 1.5, is_silent=True),
    "refused": Cut(lambda sim: (sim.operate("refuse", duration_ms=1000), sim.operate("close")), 1.0),
    "another client": Cut(_another_client),
}
ACTIVITIES = (None, *MOTIONS)


class CutOutcome(NamedTuple):
    """The times of one cut, s: from the cut until it was noticed, and from the controller's return until all works."""

    cut: str
    activity: str
    noticed: float
    usable: float


class LinkWatch:
    """A series of cuts of a LiveDriver's links, with its reactions."""

    def __init__(self, live, seed):
        self.live = live
        self.chance = random.Random(seed)
        self.outcomes: List[CutOutcome] = []
        self.written: List[float] = []
        self.asked_for = dict.fromkeys(ENERGISING.values(), 0)
        self._lost: List[float] = []
        self._samples: List[tuple] = []
        self._subscribers = [
            rospy.Subscriber("/rosout", Log, self._take_log, queue_size=1000),
            rospy.Subscriber(live.arm.name + "/joint_position", JointState, self._take_sample, queue_size=1000)]

    def _take_log(self, message):
        if message.name == self.live.arm.name and "port lost: " in message.msg:
            self._lost.append(time.monotonic())

    def _take_sample(self, message):
        self._samples.append((time.monotonic(), rospy.get_time() - message.header.stamp.to_sec(), message.position))

    def cut(self, name):
        """Make one cut of this kind, during a motion or at rest."""
        live, cut = self.live, CUTS[name]
        activity = self.chance.choice(ACTIVITIES)
        pending = None
        if activity is not None:
            pending = begin(live, activity)
        time.sleep(self.chance.uniform(0.0, 0.3))
        self.written.append(len(self.written) / 64.0)
        writing = InBackground(live.arm.call, "set_io", signal="analog", type=0, index=0, value=self.written[-1])
        struck = time.monotonic()
        cut.strike(live.simulator)
        back = struck + cut.down
        assert eventually(lambda: any(at >= struck for at in self._lost)), "%s was not noticed" % name
        noticed = min(at for at in self._lost if at >= struck)
        assert eventually(self._works), "not usable after " + name
        usable = time.monotonic()
        writing.wait()
        self._assert_nothing_moves(name, pending)
        silent_from = noticed + 0.3
        if cut.down > 0.0 and name != "silent for a while":
            shown = [at for at, _, _ in self._samples if silent_from < at < back]
            assert not shown, "published while the link was down"
        self.outcomes.append(CutOutcome(name, activity or "at rest", noticed - struck, max(0.0, usable - back)))
        self.recover()

    def _works(self):
        """Return whether both links are up, the state is fresh and the controller answers."""
        if not self.live.arm.call("get_fk", joint=HOME).cartesian_pose:
            return False
        seen = len(self._samples)
        return eventually(lambda: len(self._samples) > seen, 0.2)

    def _assert_nothing_moves(self, name, pending):
        simulator = self.live.simulator
        assert eventually(lambda: not simulator.is_moving() and not simulator.state()["is_servo_active"]), (
            "the arm moves on after " + name)
        if pending is not None:
            reply = pending.join()
            assert reply is None or reply.ret == 0, reply
        assert not simulator.is_moving(), "something resumed after " + name

    def recover(self):
        """Make the arm ready again as a person would: the driver itself energises nothing."""
        arm = self.live.arm
        self.live.simulator.operate("clear_faults")
        assert eventually(self._works)
        if not self.live.simulator.state()["is_enabled"]:
            arm.call("clear_err")
            for service in ENERGISING:
                assert eventually(lambda service=service: self._energise(service)), service
        assert eventually(lambda: arm.listen("robot_states", 1)[0].power_state == 1)

    def _energise(self, service):
        """Call a service that energises, once; a reply of the controller may be lost, so a person calls again."""
        self.asked_for[ENERGISING[service]] += 1
        return self.live.arm.call(service, data=True).success

    def reconnect(self, port):
        """Make one cut at rest and wait until all works; from one thread only, so that the driver keeps its
        connections. A driver whose command port is cut often believes in another client, and leaves it the port.
        """
        self.live.simulator.operate(self.chance.choice(("close", "reset")), port=port)
        assert eventually(self._works)

    def assert_topics_were_sane(self):
        """Assert that every sample was finite and, when it came, fresh."""
        assert self._samples
        assert all(math.isfinite(q) and abs(q) < 6.3 for _, _, position in self._samples for q in position)
        assert max(age for _, age, _ in self._samples) < 1.5, "a stale sample was published"

    def judge(self, verdict):
        """Judge by the log that nothing was sent twice, and nothing energised that was not asked for."""
        received = verdict.received()
        values = [request["value"] for _, request in received if request["cmdName"] == "set_analog_output"]
        assert len(values) == len(set(values)), "a command was sent twice"
        assert set(values) <= set(self.written)
        for name, asked in self.asked_for.items():
            assert len(verdict.times_of(name)) <= asked, "energised by itself"
        motions = [str(request) for _, request in received
                   if request["cmdName"] in MOTION_COMMANDS or request.get("jog_mode") == 1]
        assert len(motions) == len(set(motions)), "a motion was sent twice"

    def close(self):
        for subscriber in self._subscribers:
            subscriber.unregister()


class Size(NamedTuple):
    """The resources of a process: threads, file descriptors, resident memory in kB."""

    threads: int
    descriptors: int
    resident_kb: int


def size_of(pid):
    """Return the resources of a process."""
    status = dict(line.split(":", 1) for line in Path("/proc/%d/status" % pid).read_text().splitlines())
    return Size(int(status["Threads"]), len(list(Path("/proc/%d/fd" % pid).iterdir())), int(status["VmRSS"].split()[0]))
