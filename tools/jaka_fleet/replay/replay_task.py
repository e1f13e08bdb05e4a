"""One golden log replayed, as a task that an engine hands to a worker; the worker needs only this package and ROS."""
import contextlib
import json
import os
import re
import subprocess
import tempfile
import threading
import time
from pathlib import Path
from typing import Any, Dict, List, NamedTuple, Optional

from jaka_bag.engines.tasks import LogResult, LogTask
from jaka_bag.errors import BagError
from jaka_regression.processes import ChildProcess

from .driver_source import DriverSource, unpack
from .stage_process import RESULT, STAGE

_PATIENCE_S = 300.0
"""A stage may take so much longer than four times its log."""
_LOOK_S = 0.1
"""Longest wait, s, before the next look whether the task was ended."""
_REPORTS = ("report.html", "report.xml", "report.json", "candidate.mcap")

_one_stage = threading.Lock()
"""A worker may have several threads: two stages at once would keep each other from their time."""


class ReplaySettings(NamedTuple):
    """The input of a replay besides the log's name; it brings the log itself.

    Attributes:
        log: Bytes of the golden log.
        scenario: Text of the YAML file beside it; None where there is none.
        driver: The driver under test.
        tolerances: YAML text; None for those of the scenario.
        time_scale: Simulated controllers run this many times faster.
        duration_s: Length of the log, s.
    """

    log: bytes
    scenario: Optional[str]
    driver: DriverSource
    tolerances: Optional[str] = None
    time_scale: float = 1.0
    duration_s: float = 0.0


class ReplayOutcome(NamedTuple):
    """The result of a replay.

    Attributes:
        same: True if the driver did what the golden log shows.
        headline: The verdict in one line.
        summary: The verdict and the differences.
        differences: Names of the checks that failed, the worst first.
        files: Files by name: reports, the new log, and, where it is not the same, what the processes printed.
    """

    same: bool
    headline: str
    summary: str
    differences: List[str]
    files: Dict[str, bytes]


def replay_task(task: LogTask) -> LogResult:
    """Replay the log on a stage of its own, one at a time in a process; ``value`` is a ``ReplayOutcome``.

    Raises:
        BagError: The stage could not be built, or did not end.
    """
    settings: ReplaySettings = task.settings
    with _one_stage, tempfile.TemporaryDirectory(prefix="jaka_replay_") as name:
        folder = Path(name)
        job_file = _job(task.path, settings, folder)
        stage = ChildProcess("stage", [*STAGE, str(job_file)], folder)
        try:
            _wait_for(stage, 4.0 * settings.duration_s / settings.time_scale + _PATIENCE_S)
        finally:
            stage.end()
        result = _result(stage, job_file.with_name(RESULT))
        if "error" in result:
            raise BagError("%s: %s%s" % (task.path, _without(result["error"], folder), _words(folder / "run")))
        outcome = ReplayOutcome(result["same"], result["headline"], _without(result["summary"], folder),
                                result["differences"], _files(folder / "run", result["same"]))
    return LogResult(task.path, size=len(settings.log), value=outcome)


def _job(path: str, settings: ReplaySettings, folder: Path) -> Path:
    """Prepare what the stage needs; return the job file."""
    golden = folder / re.sub(r"[^\w.-]+", "_", os.path.basename(path))
    golden.write_bytes(settings.log)
    if settings.scenario is not None:
        golden.with_suffix(".yaml").write_text(settings.scenario, encoding="utf-8")
    tolerances = None
    if settings.tolerances is not None:
        tolerances = folder / "job_tolerances.yaml"
        tolerances.write_text(settings.tolerances, encoding="utf-8")
    driver = unpack(settings.driver, folder / "driver")
    job = {"golden": str(golden), "folder": str(folder / "run"), "time_scale": settings.time_scale,
           "tolerances": None if tolerances is None else str(tolerances),
           "driver": None if driver is None else str(driver)}
    (folder / "run").mkdir()
    job_file = folder / "job.json"
    job_file.write_text(json.dumps(job), encoding="utf-8")
    return job_file


def _wait_for(stage: ChildProcess, patience_s: float) -> None:
    end = time.monotonic() + patience_s
    while stage.process.poll() is None:
        if time.monotonic() > end:
            raise stage.failure("did not end in %.0f s" % patience_s)
        with contextlib.suppress(subprocess.TimeoutExpired):
            stage.process.wait(_LOOK_S)


def _result(stage: ChildProcess, file: Path) -> Dict[str, Any]:
    try:
        found = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        raise stage.failure("ended without a result") from None
    assert isinstance(found, dict)
    return found


def _words(folder: Path) -> str:
    """Return the driver's last words: an error is mostly its."""
    logs = sorted(folder.glob("driver*.log"))
    texts = [log.read_text(encoding="utf-8", errors="replace").strip()[-400:] for log in logs]
    return "".join("; %s" % " ".join(text.split()) for text in texts if text)


def _without(text: object, folder: Path) -> str:
    """Return the text without the name of a folder that is gone when it is read."""
    return str(text).replace(str(folder / "run") + "/", "").replace(str(folder) + "/", "")


def _files(folder: Path, is_same: bool) -> Dict[str, bytes]:
    paths = [folder / name for name in _REPORTS] + ([] if is_same else sorted(folder.glob("*.log")))
    return {path.name: path.read_bytes() for path in paths if path.is_file()}
