"""``jaka_bag convert``: the command line of conversion, of one file or of all in a folder."""
import argparse
import os
from pathlib import Path
from typing import List, Optional

from ..allocator import keep_freed_memory
from ..containers.index import is_rosbag2
from ..errors import BagError, UsageError
from ..operations.convert import Job, WriteResult, convert_file
from ..pipeline import WORKERS
from .main import human_bytes
from .options import (
    Report,
    add_compression,
    add_report,
    add_selection,
    add_source,
    output_of,
    selection_of,
    span_of,
)
from .quantities import count, given

EPILOG = """\
examples:
  jaka_bag convert run.bag run.mcap               MCAP, profile ros1, zstd
  jaka_bag convert run.mcap run.bag -c lz4        a bag that rosbag reads
  jaka_bag convert run.bag run --profile ros2     a rosbag2 folder for ROS 2
  jaka_bag convert run.bag small.bag -c bz2       compress (as rosbag compress -j)
  jaka_bag convert run run.bag                    a rosbag2 folder, sqlite3 or MCAP, back to ROS 1
  jaka_bag convert logs --jobs 4                  each .bag below logs, beside it as .mcap
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``jaka_bag convert`` to a parser."""
    add_source(parser, "its suffix, .bag or .mcap, decides about the format; default: SRC with the other suffix",
               source=".bag, .mcap, .mcap.active or .db3, a rosbag2 folder, or a folder: all logs in it")
    parser.add_argument("--profile", choices=("ros1", "ros2"), default="ros1",
                        help="ros1: messages as they are (default); ros2: a rosbag2 folder with CDR messages")
    many = parser.add_argument_group("a folder of files")
    many.add_argument("--to", choices=("mcap", "bag"), default="mcap",
                      help="format of the outputs (default mcap); files of that format are left alone")
    many.add_argument("--jobs", type=count, default=1, metavar="N", help="files at a time (default 1)")
    many.add_argument("--dask", type=given, metavar="ADDRESS", help="hand the files to the Dask scheduler there")
    add_selection(parser)
    add_compression(parser)
    add_report(parser)


def _default_target(source: Path, profile: str) -> Path:
    if profile == "ros2":
        return source.with_suffix("")
    with_suffix = {".bag": ".mcap", ".mcap": ".bag", ".db3": ".mcap"}.get(source.suffix)
    if with_suffix is None:
        raise BagError("%s: give the output: jaka_bag convert SRC DST" % source)
    return source.with_suffix(with_suffix)


def _job(args: argparse.Namespace, source: Path, target: Path, workers: int) -> Job:
    return Job(str(source), str(target), selection_of(args), span_of(args), args.compression, args.level,
               args.profile, args.force, workers)


def _jobs(args: argparse.Namespace, folder: Path, output: Optional[str]) -> List[Job]:
    wanted = ".bag" if args.to == "mcap" or args.profile == "ros2" else ".mcap"
    base = Path(output) if output else folder
    jobs = []
    for source in sorted(folder.rglob("*" + wanted)):
        target = base / source.relative_to(folder).with_suffix("" if args.profile == "ros2" else "." + args.to)
        jobs.append(_job(args, source, target, 1 if args.jobs > 1 or args.dask else WORKERS))
    if not jobs:
        raise BagError("%s holds no %s file" % (folder, wanted))
    for job in jobs:
        Path(job.target).parent.mkdir(parents=True, exist_ok=True)
    return jobs


def _line(result: WriteResult) -> str:
    return "%s: %d messages, %s -> %s, %.2f s" % (
        result.target, result.messages, human_bytes(result.bytes_read), human_bytes(result.bytes_written),
        result.seconds)


def _run_rosbag2(args: argparse.Namespace, folder: Path, output: Optional[str], report: Report) -> int:
    if args.profile == "ros2":
        raise UsageError("%s is a rosbag2 folder already" % folder)
    resolved = folder.resolve()
    target = Path(output) if output else resolved.with_name("%s.%s" % (resolved.name, args.to))
    with report.progress(folder) as progress:
        result = convert_file(_job(args, folder, target, WORKERS), progress)
    return report.only(_line(result), result.document(), result.notes, result.left_out > 0)


def _run_folder(args: argparse.Namespace, folder: Path, output: Optional[str], report: Report) -> int:
    if args.dask:  # the workers' current folder is another
        folder, output = Path(os.path.abspath(str(folder))), output and os.path.abspath(output)
    jobs = _jobs(args, folder, output)
    targets = {job.source: job.target for job in jobs}
    results: List[WriteResult] = []

    from ..engines.conversion import convert_task, task_of
    from ..engines.tasks import Engine, LogResult, run_tasks

    def take(outcome: LogResult) -> None:
        result: WriteResult = outcome.value or WriteResult(
            outcome.path, targets[outcome.path], error=outcome.reason, seconds=outcome.seconds)
        results.append(result)
        if result.error:
            report.tell("error", [result.error])
        else:
            report.done(_line(result))
        report.tell("note", ["%s: %s" % (result.target, note) for note in result.notes])

    engine: Engine
    if args.dask:
        from ..engines.dask_engine import Dask
        engine = Dask(args.dask)
    else:
        from ..engines.processes import Processes
        engine = Processes(max(args.jobs, 1))
    run_tasks(convert_task, map(task_of, jobs), engine, take)
    failed = sum(1 for result in results if result.error)
    report.finish({"files": [result.document() for result in results], "failed": failed})
    if failed:
        report.tell("error", ["%d of %d files failed" % (failed, len(jobs))])
    return 1 if failed or any(result.left_out for result in results) else 0


def run(args: argparse.Namespace) -> int:
    """Convert the log; return the exit code."""
    keep_freed_memory()  # processes of --jobs are forks, and do so, too
    report = Report(args)
    source = Path(args.source)
    output = output_of(args)
    if source.is_dir():
        return (_run_rosbag2 if is_rosbag2(source) else _run_folder)(args, source, output, report)
    if args.jobs > 1 or args.dask:
        raise UsageError("--jobs and --dask are for folders")
    target = Path(output) if output else _default_target(source, args.profile)
    job = _job(args, source, target, WORKERS)
    with report.progress(source) as progress:
        result = convert_file(job, progress)
    return report.only(_line(result), result.document(), result.notes, result.left_out > 0)
