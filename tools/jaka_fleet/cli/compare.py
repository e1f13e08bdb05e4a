"""``jaka_bag compare``: one run against a golden log, or many of a data set or folder."""
import argparse
import contextlib
import json
import os
import re
from pathlib import Path
from typing import Dict, List, NamedTuple, Sequence, Tuple

from jaka_bag.cli import compare
from jaka_bag.cli.main import printable
from jaka_bag.cli.options import Report
from jaka_bag.compare.comparison import CannotCompare
from jaka_bag.compare.runs.loading import load_run
from jaka_bag.compare.tolerances import ToleranceError, Tolerances, load_tolerances
from jaka_bag.compare.unmatched import unmatched_names
from jaka_bag.engines.tasks import FAILED, LogResult, LogTask, Serial, run_tasks
from jaka_bag.errors import BagError, UsageError
from jaka_bag.output_file import write_text

from ..comparing.history import RunHistory, history_of
from ..comparing.junit import as_junit
from ..comparing.outcome import DIFFERENT, NOT_COMPARED, SAME, UNKNOWN, RunOutcome, worst_first
from ..comparing.page import as_page
from ..comparing.rejudging import needs_logs, rejudged
from ..comparing.store import REPORTS, Results, Setup, stored
from ..comparing.summary import WORST, as_data, as_text
from ..comparing.task import CompareSettings, compare_task, file_hash, find_cell
from ..dataset.adding import find_logs
from ..dataset.runs import UNREADABLE, check_version, is_dataset, read_runs
from ..dataset.store import open_store
from .add import pattern
from .engine import add_engine, choose_engine, for_workers, work_through

EPILOG = """\
Does the arm still do what it did? The checks, in this order: types; counts, rates, jitter, gaps, lost messages and
stamps; alignment by the logs' own events, then by all joints together; timing and pace of each motion; joints,
positions and orientations, along their path and at their own time; sequences of states; all other fields of all topics;
service calls. A late start is no difference, a slow motion is. The last line tells what was not compared.

Tolerances: jaka_bag compare --print-tolerances > cell.yaml writes the defaults with a comment at each.

With --against, each log of a data set or a folder is compared with GOLDEN: verdicts and the margin of every check as
Parquet tables, and a page with the runs over time, what drifts since when, and trends; docs/fleet_regression.md.

Exit code: 0 same, 1 different, 2 cannot be compared (or usage).

examples:
  jaka_bag compare golden.mcap today.bag
  jaka_bag compare golden.mcap today.mcap --tolerances cell.yaml --html report.html --junit report.xml
  jaka_bag compare --audit golden.mcap
  jaka_bag compare golden.mcap --learn good_runs  > learned.yaml
  jaka_bag compare golden.mcap --against logs --jobs 4
  jaka_bag compare golden.mcap --against logs --sweep wide.yaml --sweep tight.yaml
"""

FOLDER = "compare"
"""Folder of a data set where results are."""
PAGE = "report.html"
_WORTH_BYTES = 40_000_000
"""Work, bytes, that one process does in 1.6 s: then a few have started, and done it (``bench_fleet --start``)."""


class Candidate(NamedTuple):
    """A log to compare.

    Attributes:
        path: The log.
        cell: Cell that the data set names; empty where it names none.
        cell_else: Its cell where nothing else names one.
        unreadable: Reason in the data set why it cannot be compared; empty where it may be.
    """

    path: str
    cell: str = ""
    cell_else: str = ""
    unreadable: str = ""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``jaka_bag compare``."""
    compare.add_arguments(parser)
    group = parser.add_argument_group("many runs")
    group.add_argument("--against", metavar="PATH",
                       help="compare each log of this data set (jaka_bag dataset) or folder with GOLDEN")
    group.add_argument("--results", metavar="FOLDER", help="where tables and page go, and are found again (default: "
                                                           "%s/GOLDEN-HASH below --against)" % FOLDER)
    group.add_argument("--cell", metavar="NAME", default="", help="the cell of the logs in a folder (default: as they "
                                                                  "tell it, else the folders below --against)")
    group.add_argument("--cell-from", metavar="REGEX", default="", type=pattern,
                       help="what this finds in a log's path is its cell; its first group, where it has one")
    group.add_argument("--sweep", action="append", metavar="FILE",
                       help="judge the stored results again, by the tolerances of this YAML file, without the logs; "
                            "may be repeated")
    add_engine(parser)


def results_folder(args: argparse.Namespace, golden_hash: str) -> Path:
    """Return the folder of the results."""
    if args.results:
        return Path(args.results)
    if "://" in args.against:
        raise UsageError("%s is no folder of this computer: give one for the results with --results" % args.against)
    return Path(args.against) / FOLDER / ("%s-%s" % (Path(args.golden).stem, golden_hash[:8]))


def candidates_of(args: argparse.Namespace) -> List[Candidate]:
    """Return the logs to compare, in the order of their names.

    Raises:
        BagError: There are none.
    """
    if "://" in args.against or os.path.isdir(args.against) and is_dataset(open_store(args.against)):
        found = _of_dataset(args.against)
    else:
        base, golden = Path(args.against), os.path.realpath(args.golden)
        if not base.is_dir():
            raise BagError("%s is no data set and no folder" % base)
        logs = [path for path in map(Path, find_logs([args.against])) if os.path.realpath(str(path)) != golden
                and FOLDER not in path.relative_to(base).parts[:-1]]
        found = [Candidate(str(path), args.cell, "/".join(path.relative_to(base).parts[:-1])) for path in logs]
    if not found:
        raise BagError("%s holds no log" % args.against)
    return [one._replace(path=for_workers(args, one.path)) for one in found]


def _of_dataset(location: str) -> List[Candidate]:
    store = open_store(location)
    check_version(store)
    return [Candidate(row.path, row.cell, "", row.reason if row.status == UNREADABLE else "")
            for row in read_runs(store)]


def _known(outcome: RunOutcome) -> bool:
    """Return whether the log of an outcome is still the one that was compared."""
    try:
        state = os.stat(outcome.path)
    except OSError:
        return False
    return (state.st_size, state.st_mtime_ns) == (outcome.size, outcome.mtime_ns)


def _compare_all(args: argparse.Namespace, setup: Setup, results: Results, report: Report) -> List[RunOutcome]:
    """Compare those that are not known; the outcomes of all, one for each content, and an exit code of the work."""
    candidates = candidates_of(args)
    known = {path: outcome for path, outcome in results.known().items() if _known(outcome)}
    settings = CompareSettings(os.path.abspath(setup.golden), setup.golden_hash, setup.tolerances,
                               cell_pattern=args.cell_from, time_scale=setup.time_scale)
    of_each = {one.path: settings._replace(cell=one.cell, cell_else=one.cell_else) for one in candidates}
    outcomes = [known[one.path]._replace(cell=find_cell(one.path, of_each[one.path], known[one.path].cell))
                for one in candidates if one.path in known]
    outcomes += [RunOutcome("", one.path, one.cell, reason=one.unreadable) for one in candidates if one.unreadable]
    tasks = [LogTask(one.path, of_each[one.path]) for one in candidates
             if one.path not in known and not one.unreadable]
    cells = {one.path: one.cell or one.cell_else for one in candidates}

    def take(result: LogResult) -> None:
        if result.status == FAILED:  # told already; the next call tries it again
            outcomes.append(RunOutcome("", result.path, cells[result.path], reason=result.reason))
            return
        outcome: RunOutcome = result.value
        if outcome.verdict == NOT_COMPARED:
            report.tell("error", ["%s: %s" % (result.path, outcome.reason)])
        outcomes.append(outcome)
        results.add(outcome)

    if tasks:
        work_through(compare_task, tasks, choose_engine(args, tasks, _WORTH_BYTES), report, take)
    return _one_each(outcomes, report)


def _one_each(outcomes: Sequence[RunOutcome], report: Report) -> List[RunOutcome]:
    """Drop copies: of logs with the same content keep the one whose name comes first."""
    kept: Dict[str, RunOutcome] = {}
    for outcome in sorted(outcomes, key=lambda one: one.path):
        if outcome.key in kept:
            report.tell("note", ["%s is a copy of %s" % (outcome.path, kept[outcome.key].path)])
        kept.setdefault(outcome.key, outcome)
    return sorted(kept.values(), key=lambda one: one.place)


def _report_name(outcome: RunOutcome) -> str:
    stem = re.sub(r"[^A-Za-z0-9_.-]+", "_", "_".join(filter(None, [outcome.cell, Path(outcome.path).stem])))
    return "%s-%s.html" % (stem[-120:].lstrip("."), outcome.run[:8])


def _write_run_reports(args: argparse.Namespace, setup: Setup, folder: Path, history: RunHistory,
                       report: Report) -> None:
    """Write the reports of the worst runs; keep those that are there already."""
    settings = CompareSettings(os.path.abspath(setup.golden), setup.golden_hash, setup.tolerances,
                               time_scale=setup.time_scale, with_page=True)
    worst = {run.path: run for run in worst_first(history.runs)[:WORST]}
    tasks = [LogTask(path, settings) for path, run in worst.items() if not (folder / _report_name(run)).exists()]

    def take(result: LogResult) -> None:
        if result.status == FAILED:
            report.tell("note", ["no report of %s: %s" % (result.path, result.reason)])
            return
        write_text(folder / _report_name(worst[result.path]), result.value, overwrite=True)

    if tasks:
        folder.mkdir(exist_ok=True)
        engine = choose_engine(args, tasks, _WORTH_BYTES).engine if args.dask else Serial()
        run_tasks(compare_task, tasks, engine, take)


def _links(history: RunHistory, reports: Path, page: Path) -> Dict[str, str]:
    """Return links from the page to the reports of runs that are there, by the run's key."""
    found = {run.key: reports / _report_name(run) for run in history.runs if run.verdict == DIFFERENT}
    return {key: os.path.relpath(str(path), str(page.parent)) for key, path in found.items() if path.exists()}


def _write_outputs(args: argparse.Namespace, setup: Setup, folder: Path, history: RunHistory, page: Path) -> None:
    links = _links(history, folder / REPORTS, page)
    data = json.dumps(as_data(history, setup), indent=1, allow_nan=False) + "\n"
    outputs = [(str(page), as_page(history, setup, args.against, links), True), (args.junit, as_junit(history), False),
               (args.report, data, False)]
    for path, text, is_ours in outputs:
        if path:
            write_text(path, text, args.force or is_ours and not args.html)
    if args.json:
        print(data, end="")
    else:
        print(printable(history.headline if args.quiet else as_text(history, setup, args.verbose)))
        if not args.quiet:
            print(printable("page: %s" % page))


def _code(runs: Sequence[RunOutcome]) -> int:
    if all(run.verdict == NOT_COMPARED for run in runs):
        return 2
    return 0 if all(run.verdict == SAME for run in runs) else 1


def run_against(args: argparse.Namespace, tolerances: Tolerances) -> int:
    """Compare many runs; 0 all same, 1 some different or not compared, 2 none compared."""
    report = Report(argparse.Namespace(json=args.json, quiet=args.quiet))
    place = args.against if "://" in args.against else os.path.realpath(args.against)
    setup = Setup(args.golden, file_hash(args.golden), tolerances, args.time_scale,
                  json.dumps([args.cell, args.cell_from, place]))
    folder = results_folder(args, setup.golden_hash)
    _tell_unmatched(args.golden, tolerances, report)
    with Results(folder, setup) as results:
        outcomes = _compare_all(args, setup, results, report)
        results.write(outcomes)
        history = history_of(outcomes, tolerances)
        _write_run_reports(args, setup, folder / REPORTS, history, report)
        _write_outputs(args, setup, folder, history, Path(args.html) if args.html else folder / PAGE)
    return _code(outcomes)


def _swept(name: str, setup: Setup, outcomes: Sequence[RunOutcome]) -> Tuple[Tolerances, List[RunOutcome]]:
    tolerances = load_tolerances(name)
    keys = needs_logs(setup.tolerances, tolerances)
    if keys:
        raise UsageError("%s: %s decide what is measured, not only what is allowed: compare again with --tolerances %s"
                         % (name, ", ".join(keys), name))
    return tolerances, [rejudged(outcome, tolerances, setup.time_scale) for outcome in outcomes]


def run_sweep(args: argparse.Namespace) -> int:
    """Evaluate stored results again; return 0 if all are same under each file, 1 if not, 2 without results or logs."""
    folder = results_folder(args, file_hash(args.golden))
    report = Report(argparse.Namespace(json=args.json, quiet=args.quiet))
    setup, outcomes = stored(folder)
    rows, code = [], 0
    for name in args.sweep:
        tolerances, swept = _swept(name, setup, outcomes)
        _tell_unmatched(args.golden, tolerances, report)
        changed = [(before, after) for before, after in zip(outcomes, swept) if before.verdict != after.verdict]
        counts = {verdict: sum(run.verdict == verdict for run in swept)
                  for verdict in (SAME, DIFFERENT, UNKNOWN, NOT_COMPARED)}
        rows.append({"tolerances": name, **counts, "changed": [
            {"path": after.path, "before": before.verdict, "after": after.verdict, "reason": after.reason}
            for before, after in changed]})
        code = max(code, _code(swept))
        if len(args.sweep) == 1 and (args.html or args.junit):
            other = setup._replace(tolerances=tolerances)
            _write_sweep(args, other, folder, history_of(swept, tolerances))
    if args.json:
        print(json.dumps({"format": 1, "golden": setup.golden, "sweeps": rows}, indent=1))
        return code
    for row in rows:
        print(printable("%s: %s; %d runs are judged otherwise than before" % (
            row["tolerances"], ", ".join("%d %s" % (row[verdict], verdict) for verdict in (
                SAME, DIFFERENT, UNKNOWN, NOT_COMPARED)), len(row["changed"]))))
        for entry in row["changed"] if args.verbose else []:
            print(printable("  %(path)s: %(before)s, now %(after)s: %(reason)s" % entry))
    return code


def _tell_unmatched(golden: str, tolerances: Tolerances, report: Report) -> None:
    """Print which names in the tolerances the golden log lacks; the comparison tells that it cannot be read."""
    if tolerances.joints.per_joint or tolerances.fields or tolerances.envelopes:
        with contextlib.suppress(BagError):
            names = unmatched_names(load_run(golden, tolerances), tolerances)
            report.tell("note", ["tolerances: %s" % text for text in names])


def _write_sweep(args: argparse.Namespace, setup: Setup, folder: Path, history: RunHistory) -> None:
    for path, text in ((args.html, as_page(history, setup, args.against, _links(
            history, folder / REPORTS, Path(args.html)) if args.html else {})), (args.junit, as_junit(history))):
        if path:
            write_text(path, text, args.force)


def run(args: argparse.Namespace) -> int:
    """Compare; 0 same, 1 different, 2 cannot be compared."""
    if args.against is None or args.print_tolerances:
        if (args.sweep or args.results) and not args.print_tolerances:
            raise UsageError("--sweep and --results are for many runs: say where they are with --against")
        return compare.run(args)
    try:
        return _run_many(args, load_tolerances(args.tolerances))
    except (CannotCompare, ToleranceError) as error:
        raise UsageError(str(error)) from error


def _run_many(args: argparse.Namespace, tolerances: Tolerances) -> int:
    if args.strict or args.audit or args.learn:
        raise UsageError("--strict, --audit and --learn are for one log: leave out --against")
    if args.golden is None or args.candidate is not None:
        raise UsageError("with --against one log is needed, the golden one")
    if args.sweep and args.tolerances:
        raise UsageError("--sweep brings its tolerances: leave out --tolerances")
    for name in [name for name in (args.html, args.junit, args.report) if name]:
        if not args.force and os.path.lexists(name):
            raise BagError("%s exists (--force overwrites it)" % name)
    return run_sweep(args) if args.sweep else run_against(args, tolerances)
