"""The processes of one run of a cell: those of a replay, and the user's launch file in place of the calls.

Nothing makes calls here but the cell's own nodes.
"""
import os
import re
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Dict, List, Optional, Sequence, Tuple

from .. import command_lines
from ..processes import ChildProcess, ChildProcesses, ProcessFailed
from ..scenario import BEGIN, CauseKind, ControllerEvent, Scenario
from ..stage import Script, Stage
from .world import event_as_data

_SETTLE_S = 0.5
"""Time, s, for the first inputs to reach the driver: one period of the feed, and some for a busy host."""
_QUIET_S = 8.0
"""A node that does not end by itself may do more after so long a pause: that it does is not seen."""
_LONGER = 2.0
"""Factor over the golden run after which a cell's run has no end."""
_LONGER_S = 60.0
"""Time, s, beside that: the start of its nodes."""
_DIED = re.compile(r"\[([^\]\n]+)\](?: has died!\s+|\s+)process has died \[pid \d+, exit code (-?\d+)")
_NOT_LAUNCHED = re.compile(r"cannot launch node of type [^\n]*(?:\n[^\n]*)?")


@dataclass(frozen=True)
class CellLaunch:
    """The launch file of a cell, its arguments, and when its run is over.

    Attributes:
        file: The launch file.
        arguments: Arguments for it.
        calls: The golden log's calls, in words, without repeated reads.
        lasts_s: Length of the golden log, s.
        quiet_s: A node that does not end by itself is done when as many calls have been answered as in the golden
            log and nothing has happened for so long, s, or for 8 s where that is longer.
        limit_s: Longest run, s; None for twice the golden log's length and a minute.
    """

    file: Path
    arguments: Tuple[str, ...]
    calls: Tuple[str, ...]
    lasts_s: float
    quiet_s: float
    limit_s: Optional[float] = None

    @property
    def patience_s(self) -> float:
        """The longest run, s."""
        return _LONGER * self.lasts_s + _LONGER_S if self.limit_s is None else self.limit_s


class CellStage(Stage):
    """The processes of one run of a cell.

    Args:
        processes: Takes charge of the processes.
        folder: For what they print.
        script: What is recorded.
        scenario: Arms, as they begin, and events.
    """

    def __init__(self, processes: ChildProcesses, folder: Path, script: Script, scenario: Scenario) -> None:
        super().__init__(processes, folder, script, scenario, 1.0)
        self._changed = threading.Lock()
        self._answered = 0
        self._moving: Dict[str, bool] = {}
        self._last_s = 0.0
        self._caused: List[ControllerEvent] = []

    def run_cell(self, candidate: Path, driver: Sequence[str], launch: CellLaunch) -> str:
        """Run the cell's nodes once and record it; return what went wrong with them, empty for nothing.

        Raises:
            ProcessFailed: Another process failed.
        """
        self._start_master()
        self._start_simulations()
        self._start_drivers(driver)
        self._start_watch()
        self._set_first_inputs()
        recorder = self._start_recorder(candidate)
        self._wait_for_recording()
        begun = time.monotonic()
        self._last_s = begun
        self._begin(begun)
        self._environment[command_lines.CALLERS_PATH] = os.environ.get("PYTHONPATH", "")
        cell = self._start("cell", *command_lines.LAUNCH, str(launch.file.resolve()), *launch.arguments, "--screen",
                           is_service=False)
        problem = self._wait_for_end(cell, launch, begun)
        # what the golden log has and this run has not is missing only where this log is as long
        self._let_pass(max(0.0, begun + launch.lasts_s - time.monotonic()))
        self._end_recording(recorder)
        return problem

    def _set_first_inputs(self) -> None:
        """Set what is set before the nodes begin: events at once after the beginning."""
        first = [event for event in self._scenario.events if event.after == BEGIN and event.delay_s == 0.0]
        for event in first:
            self._say_to_operator_port(event)
        if first:
            time.sleep(_SETTLE_S)

    def _events_after(self, cause: Any) -> List[ControllerEvent]:
        found = [event for event in super()._events_after(cause) if event.after != BEGIN or event.delay_s > 0.0]
        self._caused += found
        return found

    def _seen(self, event: Dict[str, Any]) -> None:
        with self._changed:
            kind = event["event"]
            if kind != "ready" and not (kind == "call" and event["is_repeated"]):
                self._last_s = time.monotonic()
            if kind == "call" and not event["is_repeated"]:
                self._answered += 1
            elif kind == "rest":
                self._moving[event["arm"]] = False
            elif kind == "seen" and event["kind"] == CauseKind.MOTION.value:
                self._moving[event["arm"]] = True
        super()._seen(event)

    def _is_over(self, launch: CellLaunch) -> bool:
        with self._changed:
            return (self._answered >= len(launch.calls) > 0 and not any(self._moving.values())
                    and time.monotonic() - self._last_s > max(launch.quiet_s, _QUIET_S))

    def _wait_for_end(self, cell: ChildProcess, launch: CellLaunch, begun: float) -> str:
        while time.monotonic() - begun < launch.patience_s:
            self._processes.check()
            if self._failure is not None:
                raise ProcessFailed(self._failure)
            died = _DIED.search(cell.printed())
            if died:
                return "the node %s died with exit code %s: %s" % (died[1], died[2], cell.last_words())
            never_began = _NOT_LAUNCHED.search(cell.printed())
            if never_began:  # roslaunch goes on without it, and ends with exit code 0
                return never_began[0]
            code = cell.process.poll()
            if code is not None:
                return "" if code == 0 else "roslaunch ended with exit code %d: %s" % (code, cell.last_words())
            if self._is_over(launch):
                return ""
            time.sleep(0.05)
        return "the cell's nodes did not end within %.0f s: %s" % (launch.patience_s, self._what_is_missing(launch))

    def _what_is_missing(self, launch: CellLaunch) -> str:
        with self._changed:
            words = ["%d of the golden log's %d calls have been answered" % (self._answered, len(launch.calls))]
            if self._answered < len(launch.calls):
                words.append("the next one there is " + launch.calls[self._answered])
            words += ["the arm %s moves" % (arm or "/") for arm, moves in self._moving.items() if moves]
            caused = list(self._caused)
        never = [event for event in self._scenario.events if event not in caused and event.after != BEGIN]
        words += ["its cause never came: %s" % event_as_data(event, len(self._scenario.arms) == 1) for event in never]
        return "; ".join(words)
