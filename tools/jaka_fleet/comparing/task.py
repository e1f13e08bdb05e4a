"""One run compared with the golden log, as a task that an engine hands to a worker."""
import contextlib
import hashlib
import os
import threading
from typing import Any, NamedTuple, Optional, Tuple

from jaka_bag.compare.comparison import CannotCompare, compare_runs
from jaka_bag.compare.report.html import as_html
from jaka_bag.compare.runs.loading import load_run
from jaka_bag.compare.runs.run import Run
from jaka_bag.compare.tolerances import Tolerances
from jaka_bag.compare.verdict import Comparison
from jaka_bag.containers.registry import open_log
from jaka_bag.engines.tasks import LogResult, LogTask
from jaka_bag.errors import BagError

from ..dataset.adding import AddSettings, cell_of
from ..dataset.log_facts import read_facts
from .outcome import RunOutcome, outcome_of

RESOLUTION = 0.02
"""Amounts are exact from this share of their limit on, so that a drift shows long before it matters."""
_BLOCK = 1 << 20
"""Bytes hashed at a time: memory stays bounded."""


class CompareSettings(NamedTuple):
    """The conditions of a run's comparison.

    Attributes:
        golden: The golden log.
        golden_hash: Its SHA-256, hex; the worker's file must have it.
        tolerances: Limits that runs must keep.
        cell: Cell of the run; empty where the log has its name, or its path.
        cell_pattern: See ``adding.AddSettings``.
        cell_else: Cell of a log for which nothing else names one.
        time_scale: The run was this many times faster.
        with_page: Make the run's own report instead: a page, HTML.
    """

    golden: str
    golden_hash: str
    tolerances: Tolerances
    cell: str = ""
    cell_pattern: str = ""
    cell_else: str = ""
    time_scale: float = 1.0
    with_page: bool = False


class _Golden(threading.local):
    """The golden log that this thread used last: it is read once, not again for each run."""

    key: Optional[Tuple[Any, ...]] = None
    run: Optional[Run] = None


_golden = _Golden()


def file_hash(path: str) -> str:
    """Compute the SHA-256 of a file, hex.

    Raises:
        BagError: It cannot be read.
    """
    digest = hashlib.sha256()
    try:
        with open(path, "rb") as file:
            for block in iter(lambda: file.read(_BLOCK), b""):
                digest.update(block)
    except OSError as error:
        raise BagError("cannot read %s: %s" % (path, error.strerror)) from error
    return digest.hexdigest()


def _golden_run(settings: CompareSettings) -> Run:
    key = settings.golden_hash, settings.golden, repr(settings.tolerances)
    if _golden.key != key or _golden.run is None:
        if file_hash(settings.golden) != settings.golden_hash:
            raise CannotCompare("%s is another file here than where the comparison was begun" % settings.golden)
        _golden.run, _golden.key = load_run(settings.golden, settings.tolerances), key
    return _golden.run


def compared(path: str, settings: CompareSettings) -> Comparison:
    """Compare one run, with amounts that are exact from ``RESOLUTION`` of their limits on.

    Raises:
        CannotCompare: The logs have no topic in common, or the golden log is another one here.
        BagError: One cannot be read.
    """
    return compare_runs(_golden_run(settings), load_run(path, settings.tolerances, settings.time_scale),
                        settings.tolerances, settings.time_scale, RESOLUTION)


def _state(path: str) -> Tuple[int, int, int]:
    found = os.stat(path)
    return found.st_size, found.st_mtime_ns, found.st_ino


def find_cell(path: str, settings: CompareSettings, known: str = "") -> str:
    """Return the cell of a log.

    Args:
        path: The log.
        settings: What names cells.
        known: The cell where the settings name none, if that is known; else the log is read.
    """
    told = known
    if not settings.cell and not known:
        with contextlib.suppress(BagError), open_log(path) as reader:
            told = read_facts(reader).cell
    return cell_of(AddSettings("", settings.cell, settings.cell_pattern), path, told or settings.cell_else)


def compare_task(task: LogTask) -> LogResult:
    """Compare the log; ``value`` is its ``RunOutcome``, or, ``with_page``, its report as HTML.

    A log that cannot be read or compared is a result, too: its outcome says why.

    Raises:
        OSError: There is no such log.
    """
    settings: CompareSettings = task.settings
    before = _state(task.path)
    size, mtime_ns, _ = before
    if settings.with_page:
        page = as_html(compared(task.path, settings), settings.tolerances)
        return LogResult(task.path, size=size, value=page)
    run = file_hash(task.path)
    cell, messages = find_cell(task.path, settings), 0
    try:
        comparison = compared(task.path, settings)
        outcome = outcome_of(comparison, run, task.path, cell, size, mtime_ns)
        messages = sum(len(stream) for stream in comparison.candidate.streams.values())
    except BagError as error:
        outcome = RunOutcome(run, task.path, cell, size, mtime_ns, reason=" ".join(str(error).split()))
    if _state(task.path) != before:
        raise BagError("%s changed while it was read: compare it again when it is whole" % task.path)
    return LogResult(task.path, size=size, messages=messages, value=outcome)
