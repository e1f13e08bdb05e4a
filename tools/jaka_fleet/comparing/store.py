"""Outcomes of many runs as two Parquet tables, and as a journal while they come.

``runs.parquet`` has a row for each run, ``checks.parquet`` one for each check of each run. Both appear only whole;
until then each outcome is a line of the journal, so that a comparison that was ended goes on where it was.
"""
import contextlib
import fcntl
import hashlib
import importlib
import json
import math
import os
import re
import sys
from pathlib import Path
from typing import IO, Any, Dict, Iterable, Iterator, List, NamedTuple, Optional, Sequence, Tuple

from jaka_bag import __version__
from jaka_bag.compare.matching.course import course_limits
from jaka_bag.compare.tolerances import ToleranceError, Tolerances, as_yaml, parse_tolerances
from jaka_bag.errors import BagError, MissingDependency, OutputExists
from jaka_bag.output_file import OutputFile

from .outcome import CheckOutcome, RunOutcome

SCHEMA_VERSION = "1"
RUNS, CHECKS, JOURNAL = "runs.parquet", "checks.parquet", "journal.jsonl"
REPORTS = "reports"
"""Folder of the reports of single runs, whose names end with the beginning of the run's hash."""
_OWN_REPORT = re.compile(r".*-[0-9a-f]{8}\.html")
_PREFIX = "jaka_bag."
_COURSE = tuple(course_limits(Tolerances()))


class Setup(NamedTuple):
    """The conditions that outcomes depend on besides the runs.

    Attributes:
        golden: The golden log.
        golden_hash: Its SHA-256, hex.
        tolerances: Limits that runs must keep.
        time_scale: Runs were this many times faster.
        cells: The options that name cells; no amount depends on them.
    """

    golden: str
    golden_hash: str
    tolerances: Tolerances
    time_scale: float = 1.0
    cells: str = ""

    def facts(self) -> Dict[str, str]:
        """Return the conditions as text, for files; those of another version of this package do not match."""
        return {"compare_schema": SCHEMA_VERSION, "version": __version__, "golden": self.golden,
                "golden_sha256": self.golden_hash, "tolerances": as_yaml(self.tolerances),
                "time_scale": "%r" % self.time_scale, "cells": self.cells}


def _is_of(facts: Dict[str, str], setup: Setup) -> bool:
    """Return whether a file's outcomes are those that a comparison would give now; the golden log may have moved."""
    wanted = setup.facts()
    return all(facts.get(name) == value for name, value in wanted.items() if name not in ("golden", "cells"))


def _arrow() -> Tuple[Any, Any]:
    try:
        return importlib.import_module("pyarrow"), importlib.import_module("pyarrow.parquet")
    except ImportError:
        raise MissingDependency("compare --against needs the Python package pyarrow") from None


def as_line(outcome: RunOutcome) -> str:
    """Return an outcome as a line of JSON, Python's with Infinity."""
    return json.dumps(outcome, separators=(",", ":")) + "\n"


def _check_of(values: Sequence[Any]) -> CheckOutcome:
    texts = [sys.intern(value) if isinstance(value, str) else value for value in values[:-1]]
    return CheckOutcome._make([*texts, tuple((float(one), float(other)) for one, other in values[-1])])


def _of_line(line: str) -> RunOutcome:
    values = json.loads(line)
    course = {name: (float(low), float(high)) for name, (low, high) in values[-2].items()}
    return RunOutcome._make([*values[:-2], course, tuple(map(_check_of, values[-1]))])


class Results:
    """The results in one folder; locked while it is open.

    Args:
        folder: Made where it is missing.
        setup: Conditions that the outcomes depend on.

    Raises:
        BagError: The folder cannot be made or written.
        OutputExists: Another process compares into it.
        MissingDependency: pyarrow is not installed.
    """

    def __init__(self, folder: Path, setup: Setup) -> None:
        _arrow()
        self.folder = folder
        self._setup = setup
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._journal: IO[str] = open(str(folder / JOURNAL), "a+", encoding="utf-8")
        except OSError as error:
            raise BagError("cannot write %s: %s" % (error.filename or folder, error.strerror)) from error
        try:
            fcntl.flock(self._journal, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self._journal.close()
            raise OutputExists("another process compares into %s" % folder) from None

    def known(self) -> Dict[str, RunOutcome]:
        """Return outcomes of earlier runs, by path; forget those of other tolerances, or of another golden log.

        The cell of one is empty where other options named it. Reports that may be of what is forgotten are removed.
        """
        found: Dict[str, RunOutcome] = {}
        kept: List[str] = []
        with contextlib.suppress(NothingStored):
            setup, outcomes = stored(self.folder)
            if _is_of(setup.facts(), self._setup):
                kept.append(setup.cells)
                found = {outcome.path: self._with_cell(outcome, setup.cells) for outcome in outcomes}
        self._journal.seek(0)
        lines = self._journal.readlines()
        head = json.dumps(self._setup.facts()) + "\n"
        facts = _head_of(lines[0], self._setup) if lines else None
        if facts is not None:
            kept.append(facts.get("cells", ""))
            for line in lines[1:]:
                with contextlib.suppress(ValueError, TypeError):  # the last one may have been cut off
                    outcome = self._with_cell(_of_line(line), kept[-1])
                    found[outcome.path] = outcome
        if set(kept) != {self._setup.cells}:
            self._forget_reports()  # before the journal says that they are of this setup
        self._journal.seek(0)
        self._journal.truncate()
        self._journal.write(head)
        for outcome in found.values():
            self._journal.write(as_line(outcome))
        self._journal.flush()
        return found

    def _with_cell(self, outcome: RunOutcome, cells: str) -> RunOutcome:
        return outcome if cells == self._setup.cells else outcome._replace(cell="")

    def _forget_reports(self) -> None:
        for path in (self.folder / REPORTS).glob("*.html"):
            if _OWN_REPORT.fullmatch(path.name):
                path.unlink()

    def add(self, outcome: RunOutcome) -> None:
        """Note one more outcome.

        Raises:
            OSError: The system refused, as with a full disk.
        """
        self._journal.write(as_line(outcome))
        self._journal.flush()

    def write(self, outcomes: Iterable[RunOutcome]) -> None:
        """Put the tables in their places; the journal is empty then.

        Raises:
            OSError: The system refused, as with a full disk; the journal stays.
        """
        runs = sorted(outcomes, key=lambda outcome: outcome.place)
        generation = hashlib.sha256("".join(map(as_line, runs)).encode("utf-8", "replace")).hexdigest()
        facts = {**self._setup.facts(), "generation": generation}
        _write(self.folder / CHECKS, _check_columns(runs), facts)
        _write(self.folder / RUNS, _run_columns(runs), facts)
        self._journal.truncate(0)

    def close(self) -> None:
        """Let others compare into the folder."""
        self._journal.close()

    def __enter__(self) -> "Results":
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


def _head_of(line: str, setup: Setup) -> Optional[Dict[str, str]]:
    """Return the facts of a journal's first line; None where its outcomes are not those of a comparison now."""
    try:
        facts = json.loads(line)
    except ValueError:
        return None
    return facts if isinstance(facts, dict) and _is_of(facts, setup) else None


def _write(path: Path, columns: Dict[str, Any], facts: Dict[str, str]) -> None:
    pa, parquet = _arrow()
    table = pa.table(columns).replace_schema_metadata({_PREFIX + name: value for name, value in facts.items()})
    buffer = pa.BufferOutputStream()
    parquet.write_table(table, buffer, compression="zstd", row_group_size=1 << 17)
    with OutputFile(path, overwrite=True) as output:
        output.write(memoryview(buffer.getvalue()))
        os.fsync(output.file.fileno())


def _run_columns(runs: Sequence[RunOutcome]) -> Dict[str, Any]:
    pa, _ = _arrow()

    def column(name: str, kind: Any) -> Any:
        return pa.array([getattr(run, name) for run in runs], kind)

    text, real, whole = pa.string(), pa.float64(), pa.int64()
    course = [[edge for name in _COURSE for edge in run.course[name]] if run.course else [] for run in runs]
    return {"run": column("run", text), "path": column("path", text), "cell": column("cell", text),
            "size": column("size", whole), "mtime_ns": column("mtime_ns", whole),
            "start": pa.array([run.start_ns for run in runs], pa.timestamp("ns", "UTC")),
            "duration_s": column("duration", real), "verdict": column("verdict", text),
            "reason": column("reason", text), "margin": column("margin", real), "worst": column("worst", text),
            "lag_s": column("lag", real), "cycle_s": column("cycle", real),
            "course": pa.array(course, pa.list_(real)), "checks": pa.array([len(run.checks) for run in runs], whole)}


def _check_columns(runs: Sequence[RunOutcome]) -> Dict[str, Any]:
    pa, _ = _arrow()
    rows = [(run, check) for run in runs for check in run.checks]
    text, real = pa.string(), pa.float64()

    def column(name: str, kind: Any) -> Any:
        return pa.array([getattr(check, name) for _, check in rows], kind)

    return {"run": pa.array([run.run for run, _ in rows], text), "cell": pa.array([run.cell for run, _ in rows], text),
            "start": pa.array([run.start_ns for run, _ in rows], pa.timestamp("ns", "UTC")),
            "check": column("aspect", text), "topic": column("topic", text), "field": column("field", text),
            "outcome": column("outcome", text), "margin": column("margin", real), "measured": column("measured", real),
            "limit": column("limit", real), "unit": column("unit", text), "at_s": column("at", real),
            "detail": column("detail", text), "golden": column("golden", text),
            "candidate": column("candidate", text),
            "evidence": pa.array([[number for pair in check.evidence for number in pair] for _, check in rows],
                                 pa.list_(real))}


class NothingStored(BagError):
    """There are no results, or not whole ones."""


def stored(folder: Path) -> Tuple[Setup, List[RunOutcome]]:
    """Read the results in a folder, in the order of time, and the conditions that they depend on.

    Raises:
        NothingStored: There are none, or none that this version understands.
        MissingDependency: pyarrow is not installed.
    """
    pa, parquet = _arrow()
    try:
        tables = [parquet.read_table(str(folder / name)) for name in (RUNS, CHECKS)]
    except (OSError, pa.ArrowInvalid) as error:
        raise NothingStored("%s holds no results of jaka_bag compare: %s" % (folder, error)) from error
    facts, others = ({key.decode(): value.decode() for key, value in (table.schema.metadata or {}).items()}
                     for table in tables)
    plain = {key[len(_PREFIX):]: value for key, value in facts.items() if key.startswith(_PREFIX)}
    if plain.get("compare_schema") != SCHEMA_VERSION:
        raise NothingStored("%s holds results of another version of jaka_bag: compare again" % folder)
    if facts.get(_PREFIX + "generation") != others.get(_PREFIX + "generation"):
        raise NothingStored("%s holds tables of two comparisons: compare again" % folder)
    try:
        tolerances = parse_tolerances(plain["tolerances"], str(folder))
    except ToleranceError as error:
        raise NothingStored("%s: compare again" % error) from error
    setup = Setup(plain["golden"], plain["golden_sha256"], tolerances, float(plain["time_scale"]),
                  plain.get("cells", ""))
    return setup, list(_outcomes(*tables))


def _outcomes(runs: Any, checks: Any) -> Iterator[RunOutcome]:
    pa, _ = _arrow()
    made = _checks_of(checks)
    columns = {name: (runs.column(name).cast(pa.int64()) if name == "start" else runs.column(name)).to_pylist()
               for name in runs.column_names}
    for row in zip(*columns.values()):
        values = dict(zip(columns, row))
        edges = values["course"]
        course = {name: (edges[2 * i], edges[2 * i + 1]) for i, name in enumerate(_COURSE)} if edges else {}
        yield RunOutcome(values["run"], values["path"], values["cell"], values["size"], values["mtime_ns"],
                         values["start"], values["duration_s"], values["verdict"], values["reason"], values["margin"],
                         values["worst"], values["lag_s"], values["cycle_s"], course,
                         tuple(next(made) for _ in range(values["checks"])))


def _checks_of(table: Any) -> Iterator[CheckOutcome]:
    names = ("check", "topic", "field", "outcome", "margin", "measured", "limit", "unit", "at_s", "detail", "golden",
             "candidate", "evidence")
    for batch in table.to_batches(8192):
        for row in zip(*(batch.column(batch.schema.get_field_index(name)).to_pylist() for name in names)):
            yield _check_of([*row[:-1], list(zip(row[-1][0::2], row[-1][1::2]))])


def finite(value: Optional[float]) -> Optional[float]:
    """Return a number for JSON, which has no infinity: that becomes None."""
    return None if value is None or not math.isfinite(value) else value
