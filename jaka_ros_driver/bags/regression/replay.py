"""A golden log happens again: simulated controllers, driver, recorder and calls together; then the comparison."""
import json
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Dict, List, Optional, Sequence, Tuple

from ..compare.comparison import compare_runs
from ..compare.loading import load_run
from ..compare.report_text import as_text, headline
from ..compare.run import Call, Run
from ..compare.tolerances import Tolerances
from ..compare.verdict import Comparison
from ..compare_cli import write_reports
from ..errors import BagError
from ..output_file import PathLike
from .processes import Program, ProgramFailed, Programs
from .scenario import Arm, Event, Scenario, scenario_of

MAX_TIME_SCALE = 10.0
DRIVER_TIMED_SERVICES = ("jog", "servo_j", "servo_p", "servo_move_enable")
"""Services whose course depends on the driver's own clock (jog watchdog, servo cycle): it runs at speed 1 only."""
_START_S = 60.0
_TAIL_S = 0.7
DRIVER = ("-c", "import sys; from jaka_ros_driver.ros.node import main; sys.exit(main())")
"""Arguments of the interpreter that start the driver."""
_MASTER = ("from rosmaster.master import Master\nimport time\nmaster = Master(0)\nmaster.start()\n"
           "print(master.uri, flush=True)\nwhile master.ok():\n    time.sleep(0.1)\n")


@dataclass(frozen=True)
class Replay:
    """What came of a golden log's replay.

    Attributes:
        same: True where the candidate does what the golden log shows.
        summary: The verdict and the differences, as text.
        comparison: All of it.
        candidate: The log recorded.
        report: The page to look at.
    """

    same: bool
    summary: str
    comparison: Comparison
    candidate: Path
    report: Path


@dataclass(frozen=True)
class Script:
    """What is to happen, and what of it is recorded.

    Attributes:
        log: A log with the calls; None where there are none.
        calls: The calls in it.
        duration: s, from its beginning.
        topics: What is recorded.
    """

    log: Optional[str]
    calls: Tuple[Call, ...]
    duration: float
    topics: Tuple[str, ...]


def script_of(run: Run) -> Script:
    """The script that a golden log is."""
    return Script(run.path if run.calls else None, run.calls, run.duration, tuple(sorted(run.streams)))


class _Stage:
    """The programs of one replay."""

    def __init__(self, programs: Programs, folder: Path, script: Script, scenario: Scenario,
                 time_scale: float) -> None:
        self._programs = programs
        self._folder = folder
        self._script = script
        self._scenario = scenario
        self._time_scale = time_scale
        self._environment: Dict[str, Optional[str]] = {}
        self._panels: Dict[str, Program] = {}
        self._ports: Dict[str, Dict[str, Any]] = {}
        self._timers: List[threading.Timer] = []
        self._failure: Optional[str] = None

    def _start(self, name: str, *arguments: str, **further: Any) -> Program:
        return self._programs.add(Program(name, arguments, self._folder, self._environment, **further))

    def run(self, candidate: Path, driver: Sequence[str]) -> None:
        """Everything, in order."""
        master = self._start("master", "-c", _MASTER)
        self._environment = {"ROS_MASTER_URI": master.first_line(_START_S), "ROS_IP": "127.0.0.1",
                             "ROS_HOME": str(self._folder), "ROS_LOG_DIR": str(self._folder / "ros_log"),
                             "ROS_HOSTNAME": None, "ROS_NAMESPACE": None}
        for number, arm in enumerate(self._scenario.arms):
            self._start_simulation(number, arm)
        recorder = self._start("recorder", "-m", "jaka_ros_driver.bags.cli", "record", "-O", str(candidate), "--force",
                               *self._script.topics)
        recorder.wait_for_words("recording to", _START_S)
        for number, arm in enumerate(self._scenario.arms):
            self._start_driver(number, arm, driver)
        if self._script.log is not None:
            self._make_calls(self._script.log)
        else:
            self._schedule(None, time.monotonic())
            self._let_pass(self._script.duration / self._time_scale + _TAIL_S)
        if self._failure is not None:
            raise ProgramFailed(self._failure)
        code = recorder.end()
        if code:
            raise ProgramFailed("the recorder failed: %s" % recorder.last_words())

    def _start_simulation(self, number: int, arm: Arm) -> None:
        simulation = self._start(
            "simulation%d" % number, "-m", "jaka_ros_driver.simulation", "--model", arm.model, "--command-port", "0",
            "--status-port", "0", "--poll-port", "0", "--time-scale", "%g" % self._time_scale, *arm.simulation)
        self._ports[arm.namespace] = simulation.first_object(_START_S)
        if any(event.arm == arm.namespace for event in self._scenario.events):
            panel = self._start("panel%d" % number, "-m", "jaka_ros_driver.simulation.panel_session",
                                str(self._ports[arm.namespace]["panel_port"]), on_line=self._panel_answered)
            panel.first_line(_START_S)
            self._panels[arm.namespace] = panel

    def _panel_answered(self, line: str) -> None:
        if '"ok": false' in line:
            self._failure = "the operator's panel refuses: %s" % line

    def _start_driver(self, number: int, arm: Arm, driver: Sequence[str]) -> None:
        ports = self._ports[arm.namespace]
        private = {"ip": "127.0.0.1", "command_port": ports["command_port"], "status_port": ports["status_port"],
                   "model": arm.model, **dict(arm.parameters)}
        self._start("driver%d" % number, *driver, "__ns:=%s" % (arm.namespace or "/"), "__name:=jaka_driver",
                    *["_%s:=%s" % (name, json.dumps(value)) for name, value in private.items()])

    def _make_calls(self, log: str) -> None:
        patience = 3.0 * self._script.duration / self._time_scale + 3.0 * _START_S
        player = self._start("calls", "-m", "jaka_ros_driver.bags.cli", "replay-commands", log,
                             "--go-to-start", "--progress", "--wait", "%g" % _START_S, "--time-scale",
                             "%g" % self._time_scale, on_line=self._call_made, is_service=False)
        code = self._wait_for(player, patience)
        if code:
            raise ProgramFailed("the calls could not be made again: %s" % player.last_words())
        last = max(call.end for call in self._script.calls)
        self._let_pass((self._script.duration - last) / self._time_scale + _TAIL_S)

    def _wait_for(self, program: Program, patience_s: float) -> int:
        """Wait for its end while all others run; its exit code."""
        end = time.monotonic() + patience_s
        while time.monotonic() < end:
            code = program.process.poll()
            if code is not None:
                return code
            self._programs.check()
            time.sleep(0.05)
        raise ProgramFailed("%s did not end: %s" % (program.name, program.last_words()))

    def _call_made(self, line: str) -> None:
        try:
            event = json.loads(line)
        except ValueError:
            return
        if event.get("event") == "begin":
            self._schedule(None, event["monotonic_s"])
        elif event.get("event") == "start":
            self._schedule(event["call"], event["monotonic_s"])

    def _schedule(self, call: Optional[int], moment: float) -> None:
        """The operator does what follows this call, or the beginning."""
        for event in self._scenario.events:
            if event.after_call == call:
                wait = max(0.0, moment + event.delay_s / self._time_scale - time.monotonic())
                timer = threading.Timer(wait, self._operate, (event,))
                timer.daemon = True
                self._timers.append(timer)
                timer.start()

    def _operate(self, event: Event) -> None:
        try:
            self._panels[event.arm].say(json.dumps(dict(event.request)))
        except ProgramFailed as error:
            self._failure = str(error)

    def _let_pass(self, seconds: float) -> None:
        """Record what happens by itself."""
        end = time.monotonic() + seconds
        while time.monotonic() < end and self._failure is None:
            self._programs.check()
            time.sleep(0.05)
        for timer in self._timers:
            timer.join(_START_S)


def _check_time_scale(script: Script, time_scale: float) -> None:
    if not 0.1 <= time_scale <= MAX_TIME_SCALE:
        raise BagError("time scale is %g; it must be 0.1 to %g" % (time_scale, MAX_TIME_SCALE))
    timed = sorted({call.short_name for call in script.calls if call.short_name in DRIVER_TIMED_SERVICES})
    if timed and time_scale != 1.0:
        raise BagError("%s calls %s, whose course depends on the driver's own clock: its time scale is 1"
                       % (script.log, ", ".join(timed)))


def record_script(script: Script, folder: Path, scenario: Scenario, time_scale: float = 1.0,
                  driver: Sequence[str] = DRIVER) -> Path:
    """Make a script happen against simulated controllers and record it; the path of the new log.

    Args:
        script: What is to happen.
        folder: For the new log and for what the programs print; it exists.
        scenario: What else is needed.
        time_scale: The simulated controllers run this many times faster, at most 10.
        driver: Arguments of the interpreter that start the driver under test.

    Raises:
        BagError: The script's course depends on the driver's own clock and time_scale is not 1.
        ProgramFailed: One of the programs failed.
    """
    _check_time_scale(script, time_scale)
    candidate = folder / "candidate.mcap"
    with Programs() as programs:
        _Stage(programs, folder, script, scenario, time_scale).run(candidate, driver)
    return candidate


def replay(golden: PathLike, folder: PathLike, tolerances: Optional[Tolerances] = None, time_scale: float = 1.0,
           scenario: Optional[Scenario] = None, driver: Sequence[str] = DRIVER) -> Replay:
    """Make a golden log happen again, compare, and leave the reports in ``folder``.

    Args:
        golden: The golden log.
        folder: Made where it is not there.
        tolerances: None for those of the scenario.
        time_scale: The simulated controllers run this many times faster, at most 10.
        scenario: What else is needed; None for the file beside the log.
        driver: Arguments of the interpreter that start the driver under test.

    Raises:
        BagError: A log cannot be read, or its course depends on the driver's own clock and time_scale is not 1.
        ProgramFailed: One of the programs failed.
    """
    place = Path(str(folder))
    place.mkdir(parents=True, exist_ok=True)
    known = scenario or scenario_of(golden)
    limits = tolerances or known.tolerances
    run = load_run(golden, limits)
    candidate = record_script(script_of(run), place, known, time_scale, driver)
    comparison = compare_runs(run, load_run(candidate, limits, time_scale), limits, time_scale)
    report = place / "report.html"
    write_reports(comparison, limits, str(report), str(place / "report.xml"), str(place / "report.json"), True)
    summary = as_text(comparison) if not comparison.same else headline(comparison)
    return Replay(comparison.same, "%s\nreport: %s" % (summary, report), comparison, candidate, report)
