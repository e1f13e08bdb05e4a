"""The replay of a golden log: simulated controllers, driver, recorder and calls together; then the comparison."""
import contextlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Dict, Iterator, List, Optional, Sequence, Tuple

from jaka_bag.cli.compare import write_reports
from jaka_bag.compare.comparison import compare_runs
from jaka_bag.compare.report.failure import REPORT_NAMES, remove_reports, write_failure
from jaka_bag.compare.report.text import as_text, headline, unmatched_lines
from jaka_bag.compare.runs.loading import load_run
from jaka_bag.compare.runs.run import Run
from jaka_bag.compare.tolerances import Tolerances
from jaka_bag.compare.verdict import Comparison
from jaka_bag.errors import BagError
from jaka_bag.paths import PathLike

from .cell.history import read_history
from .command_lines import DRIVER
from .driver_inputs import Input, SentMessage, inputs_of
from .host_watch import HostWatch
from .log_beginning import with_beginning
from .processes import ChildProcesses
from .scenario import BEGIN, CauseKind, EventCause, Scenario, scenario_of
from .stage import Script, Stage, script_of
from .uncaused_motions import in_words, uncaused_motions

CANDIDATE = "candidate.mcap"
"""Name of the log that a replay records, in the folder of its reports."""
MAX_TIME_SCALE = 10.0
"""Largest factor of the time: no computer keeps a driver's and a controller's times beyond it."""
DRIVER_TIMED_SERVICES = ("jog", "servo_j", "servo_p", "servo_move_enable")
"""Services whose course depends on the driver's own clock (jog watchdog, servo cycle): it runs at speed 1 only."""
LINK_EVENTS = ("boot", "close", "fault", "half_open", "reboot", "refuse", "reset", "stall")
"""Events of a scenario that cut or hold up the link: how long the driver takes to connect again is its own clock's."""


@dataclass(frozen=True)
class Replay:
    """The result of a golden log's replay.

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


def _driver_timed(calls: Sequence[Input], scenario: Scenario) -> str:
    """Describe what depends on the driver's own clock; empty where nothing does."""
    services = sorted({call.short_name for call in calls if call.short_name in DRIVER_TIMED_SERVICES
                       or isinstance(call, SentMessage)})
    events = sorted({str(event.request["action"]) for event in scenario.events} & set(LINK_EVENTS))
    found = [words % ", ".join(names) for words, names in (
        ("calls %s", services), ("has the link disturbed (%s)", events)) if names]
    return " and ".join(found)


def takes_time_scale(golden: PathLike) -> bool:
    """Return whether a log can be replayed at another speed: nothing in it depends on the driver's own clock.

    Raises:
        BagError: It, or the scenario beside it, cannot be read.
    """
    return not _driver_timed(inputs_of(golden, load_run(golden, with_contents=False)), scenario_of(golden))


def _check_time_scale(script: Script, scenario: Scenario, time_scale: float) -> None:
    if not 0.1 <= time_scale <= MAX_TIME_SCALE:
        raise BagError("time scale is %g; it must be 0.1 to %g" % (time_scale, MAX_TIME_SCALE))
    timed = _driver_timed(script.calls, scenario)
    if timed and time_scale != 1.0:
        raise BagError("%s %s, whose course depends on the driver's own clock: its time scale is 1"
                       % (script.log, timed))


def require_causes(run: Run, inputs: Sequence[Input], scenario: Scenario) -> None:
    """Check that each motion of a golden log comes again: a call, a message or an event of the scenario began it.

    Raises:
        BagError: A hand or the pendant moved the arm, or what did was not recorded.
    """
    seen: Dict[EventCause, float] = {BEGIN: 0.0, **{
        EventCause(CauseKind.CALL, nth=number): call.start for number, call in enumerate(run.calls)}}
    if any(event.after not in seen for event in scenario.events):
        history = read_history(run.path, [arm.namespace for arm in scenario.arms])
        seen.update({sighting.cause: sighting.at for sighting in history.sightings})
    moments: Dict[str, List[float]] = {}
    for event in scenario.events:
        if event.after in seen:
            moments.setdefault(event.arm, []).append(seen[event.after] + event.delay_s)
    found = uncaused_motions(run, inputs, moments)
    if found:
        raise BagError("%s cannot be made to happen again: %s (jaka_bag replay-motion repeats motions)"
                       % (run.path, in_words(found)))


def record_script(script: Script, folder: Path, scenario: Scenario, time_scale: float = 1.0,
                  driver: Sequence[str] = DRIVER) -> Path:
    """Make a script happen against simulated controllers and record it; return the path of the new log.

    Args:
        script: The actions to perform.
        folder: For the new log and for what the processes print; it exists.
        scenario: The arms, simulated controllers and events.
        time_scale: The simulated controllers run this many times faster, at most 10.
        driver: Arguments of the interpreter that start the driver under test.

    Raises:
        BagError: The script's course depends on the driver's own clock and time_scale is not 1.
        ProcessFailed: One of the processes failed.
    """
    _check_time_scale(script, scenario, time_scale)
    candidate = folder / CANDIDATE
    with ChildProcesses() as processes:
        Stage(processes, folder, script, scenario, time_scale).run(candidate, driver)
    return candidate


def record_wire(wire_log: PathLike, script: Script, folder: Path, scenario: Scenario, speed: float = 1.0,
                driver: Sequence[str] = DRIVER) -> Tuple[Path, Dict[str, Any]]:
    """Play a recorded controller to the driver, make the script's calls among its bytes, and record.

    Args:
        wire_log: Log of ``jaka_sim --log`` or ``jaka_sim proxy``.
        script: The calls to make, and what to record.
        folder: See ``record_script``.
        scenario: See ``record_script``; its first arm is the one whose controller was recorded.
        speed: The bytes come this many times faster, at most 10.
        driver: See ``record_script``.

    Returns:
        The new log, and what the player reports: how many requests it answered, and the names of those it could not.

    Raises:
        BagError: The script's course depends on the driver's own clock and speed is not 1.
        ProcessFailed: One of the processes failed.
    """
    _check_time_scale(script, scenario, speed)
    candidate = folder / CANDIDATE
    with ChildProcesses() as processes:
        told = Stage(processes, folder, script, scenario, speed).run_wire(str(wire_log), candidate, driver)
    return candidate, told


def judge(golden: Run, candidate: Path, place: Path, limits: Tolerances, time_scale: float,
          host: HostWatch) -> Replay:
    """Compare, and leave the reports beside the candidate.

    Args:
        golden: The golden log.
        candidate: The log recorded.
        place: The folder of the reports.
        limits: Limits that it must keep.
        time_scale: See ``record_script``.
        host: Pauses of the computer meanwhile; shown beside a difference, and no part of the verdict.

    Raises:
        BagError: The candidate cannot be read, or a report cannot be written.
    """
    run = load_run(candidate, limits, time_scale)
    return report_on(compare_runs(golden, run, limits, time_scale), place, limits, host)


def report_on(comparison: Comparison, place: Path, limits: Tolerances, host: HostWatch) -> Replay:
    """Write the reports of a comparison, and return what it says; arguments and errors as of ``judge``."""
    run, time_scale = comparison.candidate, comparison.time_scale
    html, junit, data = (str(place / name) for name in REPORT_NAMES)
    write_reports(comparison, limits, html, junit, data, True)
    lines = [headline(comparison), *unmatched_lines(comparison)] if comparison.same else [
        as_text(comparison), host.words(run.start_ns, time_scale)]
    summary = "\n".join(line for line in lines + ["report: %s" % html] if line)
    return Replay(comparison.same, summary, comparison, Path(run.path), Path(html))


@contextlib.contextmanager
def reports_of_this_run(place: Path, golden: PathLike) -> Iterator[None]:
    """Have the folder hold this run's reports only, also where the run fails: then they give the reason.

    Those of an earlier run go first: one that says "same" must not stand where the present run did not come to its end.
    """
    place.mkdir(parents=True, exist_ok=True)
    remove_reports(place)
    if (place / CANDIDATE).exists():
        (place / CANDIDATE).unlink()
    try:
        yield
    except BagError as error:
        write_failure(place, str(golden), str(error))
        raise


def replay(golden: PathLike, folder: PathLike, tolerances: Optional[Tolerances] = None, time_scale: float = 1.0,
           scenario: Optional[Scenario] = None, driver: Sequence[str] = DRIVER) -> Replay:
    """Make a golden log happen again, compare, and leave the reports of this run in ``folder``, also where it fails.

    Args:
        golden: The golden log.
        folder: Made where it is not there.
        tolerances: None for those of the scenario.
        time_scale: The simulated controllers run this many times faster, at most 10.
        scenario: The arms, simulated controllers and events; None for the file beside the log.
        driver: Arguments of the interpreter that start the driver under test.

    Raises:
        BagError: A log cannot be read, no call began a motion in it, or its course depends on the driver's own clock
            and time_scale is not 1.
        ProcessFailed: One of the processes failed.
    """
    place = Path(str(folder))
    with reports_of_this_run(place, golden):
        known = scenario or scenario_of(golden)
        limits = tolerances or known.tolerances
        run = load_run(golden, limits)
        script = script_of(run)
        require_causes(run, script.calls, known)
        known = with_beginning(known, run)
        with HostWatch() as host:
            candidate = record_script(script, place, known, time_scale, driver)
        return judge(run, candidate, place, limits, time_scale, host)
