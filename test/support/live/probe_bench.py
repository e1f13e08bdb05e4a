"""The command jaka_probe beside simulated controllers that it knows nothing of, also on a terminal with a person."""
import json
import math
import os
import pty
import re
import subprocess
import threading
import time

from command_places import command_of

from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.kinematics.forward import forward
from jaka_ros_driver.probe import report
from jaka_ros_driver.probe.ask import MALFORMED, QUESTIONS, UNKNOWN_COMMAND
from jaka_ros_driver.probe.facts import DESCRIBED, ProbeStage
from jaka_ros_driver.probe.motion import OTHERS_RAD, ROOM_M, ROOM_RAD
from jaka_ros_driver.probe.move import MOVES
from jaka_ros_driver.probe.moving import AXIS
from jaka_ros_driver.probe.set_same import ASKED_S, DRAG_COMMAND, PERIOD_COMMAND, READ_BACK, SETTINGS
from jaka_ros_driver.protocol.framing import ObjectStream
from jaka_ros_driver.simulation.dialect.dimension import FIRMWARE_NAMES
from jaka_ros_driver.simulation.dialect.table import DIMENSIONS, Dialect
from jaka_ros_driver.simulation.server.event_loop import ask_operator_port
from jaka_ros_driver.wire.log import TrueJoints, read_log

WAIT = 120.0
LONG_WAIT = 900.0
_OF_STAGE = ((ProbeStage.LOOK, ()), (ProbeStage.ASK, (*QUESTIONS, UNKNOWN_COMMAND, "malformed")),
             (ProbeStage.SET, (*SETTINGS, *READ_BACK)), (ProbeStage.MOVE, tuple(MOVES)))
MAY_SEND = {stage: frozenset(name for _, names in _OF_STAGE[:number] for name in names)
            for number, (stage, _) in enumerate(_OF_STAGE, 1)}
"""The names of all requests that the stages up to this one may send; "malformed" is the piece that is no JSON."""


def drawn(seed):
    """Return the firmware and the dialect of a seed."""
    firmware = FIRMWARE_NAMES[seed % len(FIRMWARE_NAMES)]
    return firmware, Dialect.from_seed(seed, firmware)


class Controller:
    """The executable jaka_sim on free ports, with a log of all that it is sent."""

    def __init__(self, folder, *arguments):
        self.log = folder / ("sent-%d.mcap" % time.monotonic_ns())
        self.process = subprocess.Popen(
            [*command_of("jaka_sim"), "--command-port", "0", "--status-port", "0", "--poll-port", "0", "--start",
             "enabled", "--log", str(self.log), *arguments],
            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        self.ports = json.loads(self.process.stdout.readline())

    def close(self):
        self.process.terminate()
        self.process.communicate(timeout=WAIT)

    def operate(self, action, **parameters):
        """Do something at the pendant."""
        answer = ask_operator_port(self.ports["panel_port"], {"action": action, **parameters})
        assert answer["ok"], answer

    def sent(self):
        """Return the names of the commands that it was sent, and the pieces that hold none."""
        self.close()
        names, stream = [], ObjectStream()
        for event in read_log(str(self.log)):
            if getattr(event, "port", "") == "command" and event.what == "in":
                if event.data == MALFORMED:
                    names.append("malformed")
                    continue
                names += [item["cmdName"] for item in stream.feed(event.data)]
        return names

    def is_at_rest_throughout(self):
        """Return whether the joints never moved, by the log of the arm itself."""
        return len({event.joint_position for event in read_log(str(self.log)) if isinstance(event, TrueJoints)}) == 1

    def status_bytes(self):
        return sum(len(event.data) for event in read_log(str(self.log))
                   if getattr(event, "port", "") in ("status", "poll") and event.what == "in")


def command(folder, ports, *arguments, address="127.0.0.1"):
    return [*command_of("jaka_probe"), address, "--out", str(folder), "--seconds", "1.5",
            *(word for name in ("command", "status", "poll")
              for word in ("--%s-port" % name, str(ports[name + "_port"]))), *arguments]


def probe(folder, ports, *arguments):
    done = subprocess.run(command(folder, ports, *arguments), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, text=True, timeout=WAIT)
    assert "Traceback" not in done.stdout, done.stdout
    return done


def facts_in(folder):
    return report.facts_of(report.read(str(folder / "probe.json")))


_NEAR = {"start_delay": 0.3, "link_loss_notice": 0.3, "servo_leave_delay": 0.03, "move_jerk_time": 0.04}
"""Tolerances of times, s: the period of the feed, the arm's first motion, a busy host."""


def wrong(found, dialect):
    """Return which dimensions a report has otherwise than they are."""
    rows = []
    for name, described in DESCRIBED.items():
        key = described.dimension
        true = getattr(dialect, key) if key else None
        if not key or name not in found or found[name].value is None:
            continue
        value = report.dialect_of(found)[key]
        if key == "feed_period":
            is_right = abs(value - max(true, dialect.shortest_feed_period)) < 0.002 + 0.1 * true
        elif key == "shortest_feed_period":
            is_right = abs(value - max(true, ASKED_S)) < 0.002 + 0.1 * true
        elif key == "frame_bytes":
            is_right = abs(value - true) < 20 or true < value < 7000  # as long as its fields are
        elif key == "unknown_frame_fields":
            is_right = value == (true or "vendor_block" in found[name].value)  # what fills frames up is unknown, too
        elif key == "move_acceleration":
            is_right = abs(value - true) <= 0.15 * true
        elif key in _NEAR:
            is_right = abs(value - true) <= _NEAR[key]
        elif key == "missing_commands":
            sent = {*QUESTIONS, *([DRAG_COMMAND, PERIOD_COMMAND] if "drag_command" in found else []),
                    *(["set_network_exception_handle"] if "link_loss_notice" in found else [])}
            is_right = set(value) == set(true) & sent
        else:
            is_right = value == (sorted(true, key=DIMENSIONS[key].names.index) if isinstance(true, tuple) else true)
        rows += [] if is_right else [(key, value, true)]
    return rows


_SLOWEST_FEED_S = 0.06
"""Longest period, s, of a feed that shows how an acceleration builds up: two frames fall into 0.1 s of it."""


def can_see(name, dialect):
    """Return whether this controller shows a fact to the stage that looks for it."""
    if name == "link_loss_notice":
        return dialect.knows("set_network_exception_handle")
    if name == "feed_period_asked":
        return dialect.knows(PERIOD_COMMAND)
    if name == "move_jerk_time":
        return max(dialect.feed_period, dialect.shortest_feed_period) <= _SLOWEST_FEED_S
    return True


def judged(found, mistakes, names, dialect):
    """Return "right", "wrong" or "open" for each of these facts; "unseen" where it is open and cannot be seen.

    mistakes: As of ``wrong``; what is no row of a dimension is left.
    """
    bad = {row[0] for row in mistakes if isinstance(row, tuple)}
    return {name: ("wrong" if DESCRIBED[name].dimension in bad else "right")
            if name in found and found[name].value is not None else "open" if can_see(name, dialect) else "unseen"
            for name in names}


def left_room(path, model="zu7"):
    """Return what is against a path of joints, rad, that begins where the arm was; the flange stands for the tool."""
    found = []
    for joint, (start, *others) in enumerate(zip(*path)):
        way = max((abs(one - start) for one in others), default=0.0)
        if way > (ROOM_RAD if joint == AXIS else OTHERS_RAD):
            found.append("joint %d went %.2f deg" % (joint + 1, math.degrees(way)))
    arm = load_model(model)
    begun = forward(arm, path[0])[9:]
    away = max(math.dist(forward(arm, joints)[9:], begun) for joints in set(path))
    return found + (["the flange was %.0f mm from its start" % (1000.0 * away)] if away > ROOM_M else [])


class DimensionTable:
    """The numbers of right, wrong and open findings of each dimension of drawn controllers, as a table in Markdown."""

    def __init__(self):
        self._counts = {}

    def add(self, verdicts):
        for name, verdict in verdicts.items():
            self._counts.setdefault(name, dict.fromkeys(("right", "wrong", "open"), 0))
            if verdict != "unseen":
                self._counts[name][verdict] += 1

    def sums(self, names):
        """Return the numbers of right, wrong and open findings of these facts."""
        return [sum(self._counts[name][one] for name in names) for one in ("right", "wrong", "open")]

    def lines(self):
        """Return a row for each dimension, one for each stage, and one for all."""
        names = [name for name in DESCRIBED if name in self._counts]
        rows = [(DESCRIBED[name].stage.value, "`%s`" % DESCRIBED[name].dimension, [name]) for name in names]
        rows += [(stage.value, "all %d" % len(group), group) for stage, group in (
            (stage, [name for name in names if DESCRIBED[name].stage is stage]) for stage in ProbeStage) if group]
        rows.append(("all", "all %d" % len(names), names))
        return ["| %s |" % " | ".join(row) for row in (
            ["stage", "dimension", "seen", "right", "wrong", "not settled"], ["---"] * 6,
            *([stage, key, str(sum(self.sums(group))), *map(str, self.sums(group))] for stage, key, group in rows))]


class ProbeOnTerminal:
    """The command on a pseudo-terminal; questions are answered as soon as they are asked.

    Args:
        command: Its words.
        confirm: Takes the number of steps that were confirmed already; returns the answer to the next one.
        name: Takes the arm's name as it was told; returns what is typed.
        arm: The ``Controller`` at whose pendant is done what is asked for; None for nothing.
    """

    def __init__(self, command, confirm=lambda done: "y", name=lambda told: told, arm=None):
        self._confirm, self._name, self._arm = confirm, name, arm
        self.text, self.confirmed, self._has_ended = "", 0, False
        self._news = threading.Condition()
        self._terminal, theirs = pty.openpty()
        self.process = subprocess.Popen(command, stdin=theirs, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        os.close(theirs)
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self):
        answered = 0
        while True:
            data = os.read(self.process.stdout.fileno(), 65536)
            with self._news:
                self.text += data.decode("utf-8", "replace")
                self._has_ended = not data
                self._news.notify_all()
            if not data:
                return
            if self.text.endswith("type it to go on: "):
                told = re.findall(r"Its name is (.+?); type it", self.text)[-1]
                self._type(self._name(told))
            elif self.text.endswith("y begins this step: ") and len(self.text) > answered:
                answered = len(self.text)
                if self._arm is not None and "disable the arm at the pendant" in self.text.splitlines()[-1]:
                    self._arm.operate("disable")
                answer = self._confirm(self.confirmed)
                self.confirmed += answer == "y"
                self._type(answer)
            elif self.text.endswith("End it at the pendant; y goes on: "):
                self._arm.operate("end_program")
                self._type("y")
            elif self.text.endswith("where you did not see it) "):
                self._type("")

    def _type(self, line):
        os.write(self._terminal, line.encode() + b"\n")

    def wait_for(self, text):
        """Wait until it has printed this."""
        with self._news:
            self._news.wait_for(lambda: text in self.text or self._has_ended, LONG_WAIT)
        assert text in self.text, self.text

    def end(self):
        """Wait until it has ended; return its exit code."""
        try:
            return self.process.wait(LONG_WAIT)
        finally:
            self.process.kill()
            self._reader.join()
            self.process.stdout.close()
            os.close(self._terminal)
