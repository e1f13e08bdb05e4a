"""A golden log as a rostest, for those who have no pytest: behind launch/replay_golden.test and cell_golden.test."""
import argparse
import importlib
import os
import shlex
import sys
import tempfile
import unittest
from pathlib import Path
from typing import Any, List, Optional

from jaka_bag.compare.tolerances import load_tolerances

from .cell.run import run_cell
from .replay import replay

_RESULT_FLAG = "--gtest_output=xml:"
_OF_ROSUNIT = ("--gtest_", "--text", "--cov")
"""Beginnings of the words that rostest and rosunit have for each other."""


def _report_folder(arguments: List[str], golden: Path) -> Path:
    """Return the report folder: beside the results file that rostest asks for, else among the temporary files."""
    for argument in arguments:
        if argument.startswith(_RESULT_FLAG):
            return Path(argument[len(_RESULT_FLAG):]).resolve().parent / "jaka_reports" / golden.stem
    return Path(tempfile.mkdtemp(prefix="jaka_reports_")) / golden.stem


def main(argv: Optional[List[str]] = None) -> int:
    """Run the test; rosunit writes its result where rostest wants it, and ends the process on failure.

    Args:
        argv: Without the command's name; None for those of the process, without what roslaunch adds (__name:=...).

    Returns:
        0 when the log happened again.
    """
    arguments = [word for word in sys.argv[1:] if ":=" not in word] if argv is None else argv
    parser = argparse.ArgumentParser(
        prog="jaka_rostest",
        description="Makes a golden log happen again, as a rostest: its calls, or the cell's own nodes.")
    parser.add_argument("golden", metavar="LOG", help=".bag or .mcap")
    parser.add_argument("--tolerances", metavar="FILE", help="YAML file with what differs from the defaults")
    parser.add_argument("--time-scale", type=float, default=1.0, metavar="N", help="N times faster, at most 10")
    parser.add_argument("--launch", metavar="FILE",
                        help="run the nodes that this launch file starts, once, in place of the log's calls")
    parser.add_argument("--launch-args", default="", metavar="WORDS", help="arguments for it: 'driver=false speed=2'")
    parser.add_argument("--limit", type=float, metavar="S",
                        help="longest run of those nodes; default twice the log and a minute")
    options, others = parser.parse_known_args(arguments)
    unknown = [word for word in others if not word.startswith(_OF_ROSUNIT)]
    if unknown:  # tolerances under a misspelt name would be left out, and the defaults judge
        parser.error("unrecognized arguments: %s" % " ".join(unknown))
    golden = Path(options.golden)
    words = [word.replace("=", ":=", 1) for word in shlex.split(options.launch_args)]  # roslaunch takes := for its own
    if options.launch and options.time_scale != 1.0:
        parser.error("--time-scale is for the log's calls: the cell's own nodes have their own clock")

    class GoldenLog(unittest.TestCase):
        """One golden log."""

        def test_it_happens_again(self) -> None:
            """Check that the candidate does what the golden log shows."""
            limits = load_tolerances(options.tolerances) if options.tolerances else None
            folder = _report_folder(arguments, golden)
            result = (run_cell(options.launch, golden, folder, words, limits, options.limit) if options.launch
                      else replay(golden, folder, limits, options.time_scale))
            print(result.summary, flush=True)
            self.assertTrue(result.same, result.summary)

    rosunit: Any = importlib.import_module("rosunit")
    rosunit.unitrun("jaka_ros_driver", golden.stem, GoldenLog, sysargs=["jaka_rostest", *arguments],
                    coverage_packages=[])
    return os.EX_OK
