"""One run of the cell's own nodes with a simulated controller; then the comparison with the golden log."""
import dataclasses
from pathlib import Path
from typing import List, Optional, Sequence, Tuple

from jaka_bag.compare.checks.stream_checks import common_time
from jaka_bag.compare.comparison import compare_runs
from jaka_bag.compare.runs.loading import load_run
from jaka_bag.compare.runs.run import Run
from jaka_bag.compare.tolerances import Tolerances
from jaka_bag.compare.verdict import Aspect, Check, Comparison, equal
from jaka_bag.errors import BagError
from jaka_bag.paths import PathLike

from ..command_lines import DRIVER
from ..driver_inputs import inputs_of
from ..host_watch import HostWatch
from ..log_beginning import with_beginning
from ..processes import ChildProcesses
from ..replay import CANDIDATE, Replay, report_on, reports_of_this_run, require_causes
from ..scenario import IO_TOPIC, CauseKind, Scenario, scenario_of
from ..stage import Script
from .history import CellHistory, read_history
from .launch_file import check_launch_file
from .sightings import Polls
from .stage import CellLaunch, CellStage
from .world import with_derived_events, write_scenario

_SHOWN = 200
"""Most changes of outputs that are compared in words."""


def run_cell(launch: PathLike, golden: PathLike, folder: PathLike, arguments: Sequence[str] = (),
             tolerances: Optional[Tolerances] = None, limit_s: Optional[float] = None,
             scenario: Optional[Scenario] = None, driver: Sequence[str] = DRIVER) -> Replay:
    """Run the cell's nodes once, compare with the golden log, and leave the reports in ``folder``.

    A node that dies or does not end is a difference of its own in the report.

    Args:
        launch: The launch file that starts the cell's nodes, without driver and simulated controller.
        golden: The golden log.
        folder: Made where it is not there.
        arguments: Arguments for the launch file, as ``driver:=false``.
        tolerances: None for those of the scenario.
        limit_s: Longest run of the nodes, s; None for twice the golden log's length and a minute.
        scenario: Arms, events and tolerances; None for the file beside the log. Events that it does not have are
            derived from the log, and written to ``scenario.yaml`` in the folder.
        driver: Arguments of the interpreter that start the driver.

    Raises:
        BagError: A log or the launch file cannot be read, the launch file starts a driver or a simulated controller,
            a hand or the pendant moved the arm in the golden log, or the scenario has an event after the start of a
            recorded call.
        ProcessFailed: A process other than the cell's own failed.
    """
    place, path = Path(str(folder)), Path(str(golden))
    with reports_of_this_run(place, path):
        scenario = scenario or scenario_of(path)
        limits = _without_io(tolerances or scenario.tolerances)
        run = _without_repeated_reads(load_run(path, limits))
        scenario = with_beginning(scenario, run)
        if not run.calls:
            raise BagError("%s holds no service calls: record the topic service_calls" % path)
        arms = [arm.namespace for arm in scenario.arms]
        history = read_history(path, arms)
        scenario = _events(scenario, history, path, place)
        require_causes(run, inputs_of(path, run), scenario)
        check_launch_file(Path(str(launch)), arguments, scenario)
        rest_s = run.duration - max(call.end for call in run.calls)
        cell_launch = CellLaunch(Path(str(launch)), tuple(arguments), tuple(call.words for call in run.calls),
                                 run.duration, rest_s, limit_s)
        topics = {*run.streams, *("%s/jaka_driver/%s" % (arm, IO_TOPIC) for arm in arms)}
        candidate = place / CANDIDATE
        with HostWatch() as host, ChildProcesses() as processes:
            stage = CellStage(processes, place, Script(None, (), run.duration, tuple(sorted(topics))), scenario)
            problem = stage.run_cell(candidate, driver, cell_launch)
        comparison = compare_runs(run, _without_repeated_reads(load_run(candidate, limits)), limits)
        further = [*_late_calls(comparison, limits), *_terminals(history, read_history(candidate, arms), arms)]
        if problem:
            further.insert(0, equal(Aspect.CALLS, Path(str(launch)).name, "program", False, problem))
        return report_on(dataclasses.replace(comparison, checks=(*comparison.checks, *further)), place, limits, host)


def _events(scenario: Scenario, history: CellHistory, golden: Path, place: Path) -> Scenario:
    """Return the scenario with its events or those derived from the log, which are written to the reports' folder."""
    if not scenario.has_events:
        scenario = with_derived_events(scenario, history)
        beside = golden.with_suffix(".yaml")
        notes = list(history.notes)
        if not history.begins_with:
            notes.append("inputs: the log has no %s, record that topic too" % IO_TOPIC)
        write_scenario(place / "scenario.yaml", scenario,
                       beside.read_text(encoding="utf-8") if beside.exists() else "", notes)
    if any(event.after.kind is CauseKind.CALL for event in scenario.events):
        raise BagError("%s: after_call is for replays: when a node begins a call is not seen; say after_motion, "
                       "after_output, after_input or after_answer" % golden.with_suffix(".yaml"))
    return scenario


def _without_io(limits: Tolerances) -> Tolerances:
    """Return the tolerances without the terminals' topic: how often it comes is chance; ``_terminals`` compares it."""
    return dataclasses.replace(limits, ignore_topics=(*limits.ignore_topics, ".*/jaka_driver/" + IO_TOPIC))


def _without_repeated_reads(run: Run) -> Run:
    polls = Polls()
    return dataclasses.replace(run, calls=tuple(
        call for call in run.calls if not polls.is_repeated(call.service, call.request, call.response)))


def _late_calls(comparison: Comparison, limits: Tolerances) -> List[Check]:
    """Return a difference for calls of the candidate after the golden log's end: there nothing else is compared."""
    lag = comparison.alignment.lag
    end = common_time(comparison.golden, comparison.candidate, comparison.alignment)[1] + limits.calls.timing_s
    late = [call for call in comparison.candidate.calls if call.start - lag > end]
    if not late:
        return []
    return [equal(Aspect.CALLS, late[0].service, "after the end", False, "%s at %.2f s is new: the golden log has "
                  "ended; %d such calls" % (late[0].words, late[0].start - lag, len(late)), late[0].start - lag,
                  "no such call", late[0].words)]


def _terminals(golden: CellHistory, candidate: CellHistory, arms: Sequence[str]) -> List[Check]:
    """Check that the digital outputs and inputs of each arm change in the golden log's order."""
    checks: List[Check] = []
    for arm in arms:
        if arm not in golden.begins_with:
            continue
        for kind, words in ((CauseKind.OUTPUT, "outputs"), (CauseKind.INPUT, "inputs")):
            ours, theirs = (_changes(history, arm, kind) for history in (golden, candidate))
            told = ["; ".join("%s %d %s" % (bank, index, "on" if level else "off")
                              for _, (bank, index, level) in some)[:_SHOWN] for some in (ours, theirs)]
            at = next((one[0] for one, other in zip(ours, theirs) if one[1] != other[1]),
                      ours[len(theirs)][0] if len(ours) > len(theirs) else None)
            is_same = [what for _, what in ours] == [what for _, what in theirs]
            checks.append(equal(Aspect.STATES, "%s/jaka_driver/%s" % (arm, IO_TOPIC), words, is_same,
                                "%d changes" % len(ours) if is_same else "%s change otherwise" % words, at, *told))
    return checks


def _changes(history: CellHistory, arm: str, kind: CauseKind) -> List[Tuple[float, Tuple[str, int, int]]]:
    return [(seen.at, (seen.cause.what[0], seen.cause.what[1], seen.cause.what[2])) for seen in history.sightings
            if seen.cause.kind is kind and seen.cause.arm == arm]
