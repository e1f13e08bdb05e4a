"""``jaka_bag replay``: golden logs replayed side by side against a driver."""
import argparse
import contextlib
import json
import re
import tempfile
import time
from pathlib import Path
from typing import Dict, Iterable, List, Optional

from jaka_bag.cli.options import Report, add_report
from jaka_bag.cli.quantities import positive_number
from jaka_bag.compare.report.failure import remove_reports
from jaka_bag.compare.tolerances import as_yaml, load_tolerances
from jaka_bag.containers.registry import read_index
from jaka_bag.engines.tasks import FAILED, LogResult, LogTask
from jaka_bag.errors import BagError, UsageError
from jaka_bag.output_file import OutputFile, check_output, write_text
from jaka_bag.units import NS_PER_S
from jaka_regression.replay import CANDIDATE, takes_time_scale

from ..replay.driver_source import DriverSource, driver_source
from ..replay.replay_task import ReplayOutcome, ReplaySettings, replay_task
from ..replay.report import Replayed, as_data, as_junit, as_page, as_text
from .engine import add_engine, choose_engine, work_through

PAGE = "report.html"
_LOGS = (".mcap", ".bag")
_WORTH_BYTES = 0
"""Work, bytes, from which on workers are worth their start: each replay takes longer than that, whatever its log."""

EPILOG = """\
Each golden log happens again on a stage of its own: a ROS master, simulated controllers, the driver and a recorder, all
on free ports; a worker has one stage at a time. What the driver does is compared with the log, as the fixture
jaka_replay and the test replay_golden.test do (docs/regression_testing.md). Workers on other machines need this package
and ROS; logs and driver are sent to them, the reports come back.

--against-driver takes a checkout, an install space, or a version: a tag, branch or commit of this checkout.

examples:
  jaka_bag replay goldens --jobs 2 -o reports
  jaka_bag replay goldens --against-driver 0.2.0 --dask tcp://scheduler:8786 --junit results.xml

Exit code: 0 all happened again, 1 some did not, 2 usage.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``jaka_bag replay``."""
    add = parser.add_argument
    add("goldens", nargs="+", metavar="GOLDEN", help="golden logs, or folders with such")
    add("--against-driver", metavar="PATH|VERSION", help="the driver to judge (default: this package's)")
    add("--tolerances", metavar="FILE", help="YAML file with what differs from the default tolerances (default: those "
                                             "of each log's scenario)")
    add("--time-scale", type=positive_number, default=1.0, metavar="N",
        help="simulated controllers run N times faster, at most 10, where logs allow it")
    add("-o", "--output", metavar="FOLDER", help="for a page, and a folder of reports for each log; default: a new "
                                                 "folder among the temporary files")
    add("--junit", metavar="FILE", help="write JUnit XML, a test case for each log")
    add("-f", "--force", action="store_true", help="overwrite what is in the folder")
    add_engine(parser)
    add_report(parser)


def goldens_of(words: List[str]) -> Dict[str, Path]:
    """Return the golden logs by folder name: the log's own name, with its folder's where two are the same.

    Raises:
        BagError: There is none, or one that is named is not there.
    """
    paths: List[Path] = []
    for word in words:
        path = Path(word)
        if path.is_dir():
            found = sorted(one for suffix in _LOGS for one in path.rglob("*" + suffix))
            if not found:
                raise BagError("%s holds no log" % path)
            paths += found
        elif path.is_file():
            paths.append(path)
        else:
            raise BagError("there is no %s" % path)
    named: Dict[str, Path] = {}
    for path in paths:
        stem = re.sub(r"[^\w.-]+", "_", path.stem)
        names = [stem, "%s_%s" % (re.sub(r"[^\w.-]+", "_", path.resolve().parent.name), stem)]
        name = next((one for one in names if one not in named), "%s_%d" % (names[1], len(named)))
        named[name] = path
    return named


def _settings(path: Path, driver: DriverSource, args: argparse.Namespace, limits: Optional[str]) -> ReplaySettings:
    index = read_index(path)
    beside = path.with_suffix(".yaml")
    time_scale = args.time_scale if args.time_scale == 1.0 or takes_time_scale(path) else 1.0
    return ReplaySettings(path.read_bytes(), beside.read_text(encoding="utf-8") if beside.exists() else None, driver,
                          limits, time_scale, ((index.end_time or 0) - (index.start_time or 0)) / NS_PER_S)


def _write(folder: Path, outcome: ReplayOutcome) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in outcome.files.items():
        with OutputFile(folder / name, overwrite=True) as output:
            output.write(content)


def _remove_earlier(folder: Path, names: Iterable[str]) -> None:
    """Remove what an earlier run left: none of it may be taken for this run's, which may fail or be ended."""
    for name in names:
        remove_reports(folder / name)
    for path in (folder / PAGE, *[folder / name / CANDIDATE for name in names]):
        with contextlib.suppress(FileNotFoundError):
            path.unlink()


def run(args: argparse.Namespace) -> int:
    """Replay, and write the reports; 0 all the same, 1 some not."""
    if not 0.1 <= args.time_scale <= 10.0:
        raise UsageError("--time-scale is 0.1 to 10")
    report, begin = Report(args), time.monotonic()
    goldens, driver = goldens_of(args.goldens), driver_source(args.against_driver)
    limits = as_yaml(load_tolerances(args.tolerances)) if args.tolerances else None
    folder = Path(args.output) if args.output else Path(tempfile.mkdtemp(prefix="jaka_replay_"))
    folder.mkdir(parents=True, exist_ok=True)
    page = folder / PAGE
    check_output(page, args.force)
    if args.junit:
        check_output(args.junit, args.force)
    _remove_earlier(folder, goldens)
    names = {str(path): name for name, path in goldens.items()}
    tasks = [LogTask(str(path), _settings(path, driver, args, limits)) for path in goldens.values()]
    replays: List[Replayed] = []

    def take(result: LogResult) -> None:
        name = names[result.path]
        if result.status == FAILED:
            replays.append(Replayed(name, result.path, None, result.reason, result.seconds))
            return
        _write(folder / name, result.value)
        replays.append(Replayed(name, result.path, result.value, seconds=result.seconds))

    work_through(replay_task, tasks, choose_engine(args, tasks, _WORTH_BYTES), report, take)
    replays.sort(key=lambda one: one.name)
    outputs = [(str(page), as_page(replays, driver.name, time.monotonic() - begin)),
               (args.junit, as_junit(replays, driver.name))]
    for path, text in outputs:
        if path:
            write_text(path, text, args.force)
    if args.json:
        print(json.dumps(as_data(replays, driver.name), indent=1))
    else:
        report.done(as_text(replays, driver.name) + "\npage: %s" % page)
    return 0 if all(one.verdict == "same" for one in replays) else 1
