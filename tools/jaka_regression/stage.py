"""The processes of one replay: master, simulated controllers or recorded ones, recorder, drivers, calls, operator.

``ProcessFailed`` is raised where one of them failed.
"""
import json
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Callable, Dict, List, Optional, Sequence, Tuple

from jaka_bag.compare.runs.run import Run
from jaka_bag.errors import ConnectionLost, ProtocolError
from jaka_bag.live.graph import RemoteNode
from jaka_bag.units import NS_PER_S

from . import command_lines
from .driver_inputs import Input, inputs_of
from .preconditions import KEYS
from .processes import ChildProcess, ChildProcesses, ProcessFailed
from .scenario import BEGIN, ArmSetup, CauseKind, ControllerEvent, EventCause, Scenario

_START_S = 60.0
"""Longest wait, s, for a process to be there: imports of ROS on a busy host."""
_RECORDER = "/recorder"
_LAST_OFFERED = "stop_move"
"""A service of each driver. A driver offers its services after its topics."""
_TAIL_S = 0.7
"""Time, s, that is recorded behind the golden log's end: what comes a little later must not be missed."""
_PATIENCE_ALONE_S = 0.5
"""Longest wait, s, for a recorded request where no calls are made: all but the driver's own will not come."""


@dataclass(frozen=True)
class Script:
    """The actions of a replay, and what of them is recorded.

    Attributes:
        log: A log with the calls and messages; None where there are none.
        calls: The calls in it, and the messages that drivers took.
        duration: Length of the script, s.
        topics: Topics to record.
        start_ns: Time at which the log began, ns since the epoch.
    """

    log: Optional[str]
    calls: Tuple[Input, ...]
    duration: float
    topics: Tuple[str, ...]
    start_ns: int = 0


def script_of(run: Run) -> Script:
    """Return the script of a golden log."""
    inputs = tuple(inputs_of(run.path, run))
    return Script(run.path if inputs else None, inputs, run.duration, tuple(sorted(run.streams)), run.start_ns)


class Stage:
    """The processes of one replay."""

    def __init__(self, processes: ChildProcesses, folder: Path, script: Script, scenario: Scenario,
                 time_scale: float) -> None:
        self._processes = processes
        self._folder = folder
        self._script = script
        self._scenario = scenario
        self._time_scale = time_scale
        self._environment: Dict[str, Optional[str]] = {}
        self._operator_ports: Dict[str, ChildProcess] = {}
        self._ports: Dict[str, Dict[str, Any]] = {}
        self._watch: Optional[ChildProcess] = None
        self._operators: List[threading.Thread] = []
        self._failure: Optional[str] = None

    def _start(self, name: str, *arguments: str, **further: Any) -> ChildProcess:
        return self._processes.begin(name, arguments, self._folder, self._environment, **further)

    def run(self, candidate: Path, driver: Sequence[str]) -> None:
        """Run a replay with simulated controllers, each step in order."""
        self._start_master()
        self._start_simulations()
        recorder = self._start_recorder(candidate)
        self._start_drivers(driver)
        self._wait_for_recording()
        if any(event.after.kind not in (CauseKind.BEGIN, CauseKind.CALL) for event in self._scenario.events):
            self._start_watch()
        rest = self._script.duration
        if self._script.log is not None:
            self._wait_for_calls(self._start_calls(self._script.log), 3.0 * rest / self._time_scale + 3.0 * _START_S)
            rest -= max(call.end for call in self._script.calls)
        else:
            self._begin(time.monotonic())
        self._let_pass(rest / self._time_scale)
        self._end_recording(recorder)

    def run_wire(self, wire_log: str, candidate: Path, driver: Sequence[str]) -> Dict[str, Any]:
        """Run a replay with a recorded controller, each step in order; return what its player reports at the end."""
        self._start_master()
        began, ended = threading.Event(), threading.Event()
        told: Dict[str, Any] = {}

        def hear(line: str) -> None:
            event = json.loads(line)
            if event.get("event") in ("begin", "end"):
                told[event["event"]] = event
                (began if event["event"] == "begin" else ended).set()

        alone = ("--patience", "%g" % _PATIENCE_ALONE_S) if self._script.log is None else ()
        replayer = self._start("wire", *command_lines.REPLAYER, wire_log, "--speed",
                             "%g" % self._time_scale, *alone, on_line=hear)
        facts = replayer.first_object(_START_S)
        self._ports[self._scenario.arms[0].namespace] = facts
        recorder = self._start_recorder(candidate)
        self._start_drivers(driver)
        calls = self._start_calls(self._script.log, "--begin-at-stdin") if self._script.log is not None else None
        if not self._wait_until(began.is_set, _START_S):
            raise ProcessFailed("the driver does not connect")
        if calls is not None:
            # both logs tell real time: the calls keep their places among the recorded bytes
            log_begins = self._script.start_ns - facts["start_ns"] - facts["realtime_minus_monotonic_ns"]
            calls.say("%.6f" % (told["begin"]["monotonic_s"] + log_begins / NS_PER_S / self._time_scale))
        if not self._wait_until(ended.is_set, facts["duration_s"] / self._time_scale + _START_S):
            raise ProcessFailed("the play does not end")
        if calls is not None:
            self._wait_for_calls(calls, _START_S)
        self._let_pass(0.0)
        self._end_recording(recorder)
        return dict(told["end"])

    def _wait_until(self, is_there: Callable[[], bool], patience_s: float) -> bool:
        """Wait for something while all processes run; False where it did not come in time, s."""
        end = time.monotonic() + patience_s
        while not is_there():
            self._processes.check()
            if time.monotonic() > end:
                return False
            time.sleep(0.05)
        return True

    def _start_master(self) -> None:
        master = self._start("master", *command_lines.MASTER)
        self._environment = {"ROS_MASTER_URI": master.first_line(_START_S), "ROS_IP": "127.0.0.1",
                             "ROS_HOME": str(self._folder), "ROS_LOG_DIR": str(self._folder / "ros_log"),
                             "ROS_HOSTNAME": None, "ROS_NAMESPACE": None}

    def _start_recorder(self, candidate: Path) -> ChildProcess:
        recorder = self._start("recorder", *command_lines.JAKA_BAG, "record", "-O", str(candidate), "--force",
                               "__name:=" + _RECORDER[1:], *self._script.topics)
        recorder.wait_for_words("recording to", _START_S)
        return recorder

    def _start_drivers(self, driver: Sequence[str]) -> None:
        for number, arm in enumerate(self._scenario.arms):
            self._start_driver(number, arm, driver)

    def _wait_for_recording(self) -> None:
        """Wait until the recorder has a link to each topic of the drivers: what they publish earlier is in no log."""
        nodes = [arm.namespace.rstrip("/") + "/jaka_driver" for arm in self._scenario.arms]
        with RemoteNode(str(self._environment["ROS_MASTER_URI"]), "/replay") as master:
            if not self._wait_until(lambda: all(self._is_recorded(master, node) for node in nodes), _START_S):
                raise ProcessFailed("the recorder does not hear the drivers")

    def _is_recorded(self, master: RemoteNode, driver: str) -> bool:
        try:
            publishers, _, services = master.call("getSystemState")
            if not any(name == driver + "/" + _LAST_OFFERED for name, _ in services):
                return False
            with RemoteNode(str(master.call("lookupNode", driver)), "/replay") as node:
                heard = {link[4] for link in node.call("getBusInfo") if link[1] == _RECORDER and link[2] == "o"}
        except (ConnectionLost, ProtocolError):
            return False
        return heard >= {topic for topic, names in publishers if driver in names and topic in self._script.topics}

    def _end_recording(self, recorder: ChildProcess) -> None:
        if self._failure is not None:
            raise ProcessFailed(self._failure)
        if recorder.end():
            raise ProcessFailed("the recorder failed: %s" % recorder.last_words())

    def _start_simulations(self) -> None:
        for number, arm in enumerate(self._scenario.arms):
            self._start_simulation(number, arm)

    def _start_simulation(self, number: int, arm: ArmSetup) -> None:
        state = self._folder / ("begin%d.json" % number)
        state.write_text(json.dumps(dict(arm.state), indent=1) + "\n", encoding="utf-8")
        simulation = self._start(
            "simulation%d" % number, *command_lines.SIMULATION, "--model", arm.model, "--command-port", "0",
            "--status-port", "0", "--poll-port", "0", "--time-scale", "%g" % self._time_scale, "--begin-with",
            str(state), *arm.simulation)
        self._ports[arm.namespace] = simulation.first_object(_START_S)
        if any(event.arm == arm.namespace for event in self._scenario.events):
            session = self._start("operator%d" % number, *command_lines.OPERATOR_SESSION,
                                  str(self._ports[arm.namespace]["panel_port"]), on_line=self._operator_answered)
            session.first_line(_START_S)
            self._operator_ports[arm.namespace] = session

    def _operator_answered(self, line: str) -> None:
        if '"ok": false' in line:
            self._failure = "the operator port refuses: %s" % line

    def _start_driver(self, number: int, arm: ArmSetup, driver: Sequence[str]) -> None:
        ports = self._ports[arm.namespace]
        # the guard takes a driver that gets no time on a busy host for a dead one, and stops the arm
        private = {"guard": False, "ip": "127.0.0.1", "command_port": ports["command_port"],
                   "status_port": ports["status_port"], "model": arm.model, **dict(arm.parameters)}
        self._start("driver%d" % number, *driver, "__ns:=%s" % (arm.namespace or "/"), "__name:=jaka_driver",
                    *["_%s:=%s" % (name, json.dumps(value)) for name, value in private.items()])

    def _start_calls(self, log: str, *further: str) -> ChildProcess:
        # Nothing real moves here, and what differs is for the comparison to show; a broken clock has no times.
        anyway = [word for key in KEYS if key != "clock" for word in ("--anyway", key)]
        return self._start("calls", *command_lines.JAKA_BAG, "replay-commands", log, "--go-to-start", *anyway,
                           "--progress", "--wait", "%g" % _START_S, "--time-scale", "%g" % self._time_scale, *further,
                           on_line=self._call_made, is_service=False)

    def _wait_for_calls(self, calls: ChildProcess, patience_s: float) -> None:
        if not self._wait_until(lambda: calls.process.poll() is not None, patience_s):
            raise calls.failure("did not end")
        if calls.process.returncode:
            raise ProcessFailed("the calls could not be made again: %s" % calls.last_words())

    def _call_made(self, line: str) -> None:
        try:
            event = json.loads(line)
        except ValueError:
            return
        if event.get("event") == "begin":
            self._begin(event["monotonic_s"])
        elif event.get("event") == "start" and event["call"] is not None:
            self._schedule(EventCause(CauseKind.CALL, "", (), event["call"]), event["monotonic_s"])

    def _start_watch(self) -> None:
        """Start the watch for causes that only the graph shows, and wait until it is ready."""
        arms = [arm.namespace for arm in self._scenario.arms]
        ready = threading.Event()

        def hear(line: str) -> None:
            event = json.loads(line)
            if event["event"] == "ready":
                ready.set()
            self._seen(event)

        self._watch = self._start("watch", *command_lines.LIVE_WATCH, json.dumps(arms), on_line=hear)
        if not self._wait_until(ready.is_set, 2.0 * _START_S):
            raise self._watch.failure("is not ready")

    def _seen(self, event: Dict[str, Any]) -> None:
        """Take what the watch tells."""
        if event["event"] == "seen":
            self._schedule(EventCause(CauseKind(event["kind"]), event["arm"], tuple(event["what"]), event["nth"]),
                           event["monotonic_s"])

    def _begin(self, moment: float) -> None:
        """Begin the run, at a time of the monotonic clock, s: from here on causes are counted."""
        if self._watch is not None:
            self._watch.say("begin")
        self._schedule(BEGIN, moment)

    def _schedule(self, cause: EventCause, moment: float) -> None:
        """Start what the operator does after a cause.

        A recorded controller has no operator port: what was done there is in its bytes.
        """
        events = sorted(self._events_after(cause), key=lambda event: event.delay_s)
        if events:
            operator = threading.Thread(target=self._operate, args=(events, moment), daemon=True)
            self._operators.append(operator)
            operator.start()

    def _events_after(self, cause: EventCause) -> List[ControllerEvent]:
        return [event for event in self._scenario.events if event.after == cause and event.arm in self._operator_ports]

    def _say_to_operator_port(self, event: ControllerEvent) -> None:
        self._operator_ports[event.arm].say(json.dumps(dict(event.request)))

    def _operate(self, events: Sequence[ControllerEvent], moment: float) -> None:
        """Send the operator's requests one after the other, even where this computer is late with all of them."""
        try:
            for event in events:
                time.sleep(max(0.0, moment + event.delay_s / self._time_scale - time.monotonic()))
                self._say_to_operator_port(event)
        except ProcessFailed as error:
            self._failure = str(error)

    def _let_pass(self, seconds: float) -> None:
        """Wait so long, s, and for what is still on its way then, while everything is recorded."""
        self._wait_until(lambda: self._failure is not None, seconds + _TAIL_S)
        for operator in self._operators:
            operator.join(_START_S)
