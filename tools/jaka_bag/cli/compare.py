"""``jaka_bag compare``: the comparison of one log with a golden one.

The subcommand, which compares many as well, is in ``jaka_fleet``.
"""
import argparse
import json
import sys
from pathlib import Path
from typing import Callable, List, Optional, Tuple

from ..compare.comparison import CannotCompare, compare_logs
from ..compare.report.html import as_html
from ..compare.report.junit import as_junit
from ..compare.report.text import as_data, as_text, headline
from ..compare.tolerances import ToleranceError, Tolerances, as_yaml, load_tolerances
from ..compare.verdict import Comparison
from ..errors import UsageError
from ..output_file import OutputFile, check_output
from .main import printable
from .quantities import positive_number


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options for one log to a parser, which may have those for many as well."""
    add = parser.add_argument
    add("golden", nargs="?", metavar="GOLDEN", help="log of what ought to happen, .bag or .mcap")
    add("candidate", nargs="?", metavar="CANDIDATE", help="log of what happened")
    add("--tolerances", metavar="FILE", help="YAML file with what differs from the default tolerances")
    add("--html", metavar="FILE", help="write a page to look at")
    add("--junit", metavar="FILE", help="write JUnit XML, a test case for each check")
    add("--report", metavar="FILE", help="write the result as JSON")
    add("--json", action="store_true", help="the result as JSON on stdout")
    add("--time-scale", type=positive_number, default=1.0, metavar="N", help="the candidate ran N times faster")
    add("-f", "--force", action="store_true", help="overwrite the outputs")
    add("-v", "--verbose", action="store_true", help="every check, not only the differences")
    add("-q", "--quiet", action="store_true", help="only the verdict")
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
    for path, text in reports:
        if path:
            with OutputFile(path, overwrite) as output:
                output.write(text().encode("utf-8", "replace"))


def run(args: argparse.Namespace) -> int:
    """Compare two logs; 0 same, 1 different, 2 cannot be compared."""
    try:
        tolerances = load_tolerances(args.tolerances)
        if args.print_tolerances:
            sys.stdout.write(as_yaml(tolerances))
            return 0
        if not (args.golden and args.candidate):
            raise UsageError("GOLDEN and CANDIDATE are needed")
        for name in [name for name in (args.html, args.junit, args.report) if name]:
            if Path(name).resolve() in (Path(args.golden).resolve(), Path(args.candidate).resolve()):
                raise UsageError("%s is one of the logs" % name)
            check_output(name, args.force)
        comparison = compare_logs(args.golden, args.candidate, tolerances, args.time_scale)
    except (CannotCompare, ToleranceError) as error:
        raise UsageError(str(error)) from error
    write_reports(comparison, tolerances, args.html, args.junit, args.report, args.force)
    if args.json:
        print(json.dumps(as_data(comparison), indent=1, allow_nan=False))
        return 0 if comparison.same else 1
    print(printable(headline(comparison) if args.quiet else as_text(comparison, args.verbose)))
    return 0 if comparison.same else 1
