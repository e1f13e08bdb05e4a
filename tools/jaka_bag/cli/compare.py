"""``jaka_bag compare``: the comparison of one log with a golden one.

The subcommand, which compares many as well, is in ``jaka_fleet``.
"""
import argparse
import json
import os
import sys
from pathlib import Path
from typing import Callable, List, Optional, Tuple

from ..allocator import keep_freed_memory
from ..compare.audit.auditing import audit, finding_line, summary
from ..compare.comparison import CannotCompare, compare_logs
from ..compare.learning import learn
from ..compare.report.audit_page import audit_page
from ..compare.report.failure import failure_texts
from ..compare.report.html import as_html
from ..compare.report.junit import as_junit
from ..compare.report.text import as_data, as_text, coverage_line, headline, unmatched_lines
from ..compare.tolerances import ToleranceError, Tolerances, as_yaml, load_tolerances
from ..compare.verdict import Comparison
from ..errors import BagError, UsageError
from ..output_file import check_output, write_text
from .main import printable
from .quantities import positive_number


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options for one log to a parser, which may have those for many as well."""
    add = parser.add_argument
    add("golden", nargs="?", metavar="GOLDEN", help="log of what ought to happen: .bag, .mcap, .db3, rosbag2 folder")
    add("candidate", nargs="?", metavar="CANDIDATE", help="log of what happened")
    add("--tolerances", metavar="FILE", help="YAML file with what differs from the default tolerances")
    add("--html", metavar="FILE", help="write a page to look at, also with --audit")
    add("--junit", metavar="FILE", help="write JUnit XML, a test case for each check")
    add("--report", metavar="FILE", help="write the result as JSON")
    add("--json", action="store_true", help="the result as JSON on stdout")
    add("--time-scale", type=positive_number, default=1.0, metavar="N", help="the candidate ran N times faster")
    add("-f", "--force", action="store_true", help="overwrite the outputs")
    add("-v", "--verbose", action="store_true", help="every check, not only the differences")
    add("--strict", action="store_true", help="a difference is, too: what nothing compares, unless ignore_fields "
                                              "names it; a name in the tolerances that GOLDEN lacks")
    add("-q", "--quiet", action="store_true", help="only the verdict")
    add("--audit", action="store_true", help="plant some sixty defects into GOLDEN, each alone, and print which of "
                                             "them a comparison with these tolerances would miss")
    add("--learn", metavar="FOLDER", help="print tolerances from logs of good runs: tight where the cell repeats "
                                          "itself, else wide")
    add("--print-tolerances", action="store_true", help="print the tolerances in force as YAML, and end")


def write_reports(comparison: Comparison, tolerances: Tolerances, html: Optional[str] = None,
                  junit: Optional[str] = None, json_file: Optional[str] = None, overwrite: bool = False) -> None:
    """Write the reports that have a name.

    Raises:
        OutputExists: One exists and ``overwrite`` is False.
        BagError: One cannot be created.
    """
    reports: List[Tuple[Optional[str], Callable[[], str]]] = [
        (html, lambda: as_html(comparison, tolerances)), (junit, lambda: as_junit(comparison)),
        (json_file, lambda: json.dumps(as_data(comparison), indent=1, allow_nan=False) + "\n")]
    for path, text in [(path, text()) for path, text in reports if path]:
        write_text(path, text, overwrite)


def _compared(args: argparse.Namespace, tolerances: Tolerances) -> Comparison:
    """Compare the two logs; where that fails the reports give the reason, and are not those of an earlier run."""
    keep_freed_memory()
    try:
        return compare_logs(args.golden, args.candidate, tolerances, args.time_scale)
    except BagError as error:
        for path, text in zip((args.html, args.junit, args.report), failure_texts(args.golden, str(error))):
            if path:
                write_text(path, text, args.force)
        raise


def _check_report(args: argparse.Namespace, name: str) -> None:
    if os.path.realpath(name) in [os.path.realpath(log) for log in (args.golden, args.candidate) if log]:
        raise UsageError("%s is one of the logs" % name)
    check_output(name, args.force)


def _require_golden_alone(args: argparse.Namespace, mode: str, taken: Tuple[str, ...]) -> None:
    """Raise UsageError where there is not one log, or an option that a mode does not take."""
    if not args.golden or args.candidate:
        raise UsageError("with %s one log is needed, the golden one" % mode)
    others = [name for name in ("html", "junit", "report", "json", "force", "verbose", "strict", "quiet")
              if getattr(args, name) and name not in taken]
    if args.time_scale != 1.0:
        others.append("time-scale")
    if others:
        raise UsageError("%s does not take --%s" % (mode, ", --".join(others)))


def _audit(args: argparse.Namespace, tolerances: Tolerances) -> int:
    """Print the table of an audit; return 0 where no defect is missed, else 1."""
    _require_golden_alone(args, "--audit", ("html", "force", "quiet"))
    if args.html:
        _check_report(args, args.html)
    findings = audit(args.golden, tolerances, lambda finding: None if args.quiet else print(
        printable(finding_line(finding)), flush=True))
    if args.html:
        write_text(args.html, audit_page(args.golden, findings, tolerances), args.force)
    print(printable(summary(findings)))
    return 1 if any(finding.is_missed for finding in findings) else 0


def _learn(args: argparse.Namespace, tolerances: Tolerances) -> int:
    """Print what good runs teach, as a tolerance file; tell which of them the others do not cover."""
    _require_golden_alone(args, "--learn", ("quiet",))
    if not os.path.isdir(args.learn):
        raise UsageError("--learn: %s is no folder" % args.learn)
    good = sorted(path for path in Path(args.learn).iterdir() if path.suffix in (".bag", ".mcap"))
    learned = learn(args.golden, good, tolerances)
    sys.stdout.write(printable("# Learned from %d runs in %s, of %s." % (len(good), args.learn, args.golden)) + "\n")
    sys.stdout.write(as_yaml(learned.tolerances))
    if not args.quiet:
        for name, limit, before in learned.wider:
            print(printable("wider than before: %s: up to %.4g in place of %.4g" % (name, limit, before)),
                  file=sys.stderr)
        for path, name in learned.left_out:
            print(printable("%s would be different by what the others teach: %s" % (path, name)), file=sys.stderr)
        print("%d of %d runs would be the same by what the others teach"
              % (len(good) - len(learned.left_out), len(good)), file=sys.stderr)
    return 0


def run(args: argparse.Namespace) -> int:
    """Compare two logs, or audit or learn; 0 same or nothing missed, 1 different or missed, 2 cannot be compared."""
    try:
        tolerances = load_tolerances(args.tolerances)
        if args.print_tolerances:
            sys.stdout.write(as_yaml(tolerances))
            return 0
        if args.learn and args.audit:
            raise UsageError("--audit and --learn are two questions: ask one at a time")
        if args.learn:
            return _learn(args, tolerances)
        if args.audit:
            return _audit(args, tolerances)
        if not (args.golden and args.candidate):
            raise UsageError("GOLDEN and CANDIDATE are needed")
        for name in [name for name in (args.html, args.junit, args.report) if name]:
            _check_report(args, name)
        comparison = _compared(args, tolerances)
    except (CannotCompare, ToleranceError) as error:
        raise UsageError(str(error)) from error
    write_reports(comparison, tolerances, args.html, args.junit, args.report, args.force)
    if args.json:
        print(json.dumps(as_data(comparison), indent=1, allow_nan=False))
    else:
        print(printable(headline(comparison) if args.quiet else as_text(comparison, args.verbose)))
    has_gap = args.strict and not comparison.coverage.is_whole
    if has_gap:
        print(printable("--strict: " + coverage_line(comparison)), file=sys.stderr)
    for line in unmatched_lines(comparison) if args.strict or args.quiet or args.json else []:
        print(printable("jaka_bag compare: " + line), file=sys.stderr)
    is_strange = args.strict and bool(comparison.unmatched)
    return 0 if comparison.same and not has_gap and not is_strange else 1
