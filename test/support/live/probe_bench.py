"""The command jaka_probe beside simulated controllers that it knows nothing of, also on a terminal with a person."""
import json
import os
import pty
import re
import subprocess
import threading
import time

from command_places import command_of

from jaka_ros_driver.probe import report
from jaka_ros_driver.probe.ask import MALFORMED, QUESTIONS, UNKNOWN_COMMAND
from jaka_ros_driver.probe.facts import DESCRIBED, ProbeStage
from jaka_ros_driver.probe.move import MOVES
from jaka_ros_driver.probe.set_same import DRAG_COMMAND, READ_BACK, SETTINGS
from jaka_ros_driver.protocol.framing import ObjectStream
from jaka_ros_driver.simulation.dialect.table import DIMENSIONS
from jaka_ros_driver.simulation.server.event_loop import ask_operator_port
from jaka_ros_driver.wire.log import TrueJoints, read_log

WAIT = 120.0
LONG_WAIT = 900.0
_OF_STAGE = ((ProbeStage.LOOK, ()), (ProbeStage.ASK, (*QUESTIONS, UNKNOWN_COMMAND, "malformed")),
             (ProbeStage.SET, (*SETTINGS, *READ_BACK)), (ProbeStage.MOVE, tuple(MOVES)))
MAY_SEND = {stage: frozenset(name for _, names in _OF_STAGE[:number] for name in names)
            for number, (stage, _) in enumerate(_OF_STAGE, 1)}
"""The names of all requests that the stages up to this one may send; "malformed" is the piece that is no JSON."""


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
        elif key == "frame_bytes":
            is_right = abs(value - true) < 20 or true < value < 7000  # as long as its fields are
        elif key == "unknown_frame_fields":
            is_right = value == (true or "vendor_block" in found[name].value)  # what fills frames up is unknown, too
        elif key == "move_acceleration":
            is_right = abs(value - true) <= 0.15 * true
        elif key in _NEAR:
            is_right = abs(value - true) <= _NEAR[key]
        elif key == "missing_commands":
            sent = {*QUESTIONS, *([DRAG_COMMAND] if "drag_command" in found else []),
                    *(["set_network_exception_handle"] if "link_loss_notice" in found else [])}
            is_right = set(value) == set(true) & sent
        else:
            is_right = value == (sorted(true, key=DIMENSIONS[key].names.index) if isinstance(true, tuple) else true)
        rows += [] if is_right else [(key, value, true)]
    return rows


def judged(found, mistakes, names):
    """Return "right", "unknown" or "wrong" for the dimension of each of these facts.

    mistakes: As of ``wrong``; what is no row of a dimension is left.
    """
    bad = {row[0] for row in mistakes if isinstance(row, tuple)}
    verdicts = {}
    for name in names:
        key = DESCRIBED[name].dimension
        is_open = name not in found or found[name].value is None
        verdicts[key] = "unknown" if is_open else "wrong" if key in bad else "right"
    return verdicts


class DimensionTable:
    """The numbers of right, open and wrong findings of each dimension of drawn controllers, as a table in Markdown."""

    def __init__(self):
        self._counts = {}

    def add(self, verdicts):
        for key, verdict in verdicts.items():
            self._counts.setdefault(key, dict.fromkeys(("right", "unknown", "wrong"), 0))[verdict] += 1

    def lines(self):
        rows = [["`%s`" % key, *map(str, self._counts[key].values())] for key in DIMENSIONS if key in self._counts]
        total = ["all", *(str(sum(row[one] for row in self._counts.values())) for one in ("right", "unknown", "wrong"))]
        return ["| %s |" % " | ".join(row) for row in (
            ["dimension", "right", "not settled", "wrong"], ["---"] * 4, *rows, total)]


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
