"""``jaka_bag convert``: the command line of conversion, of one file or of all in a folder."""
import argparse
from pathlib import Path
from typing import List

from ..errors import BagError, UsageError
from ..operations.convert import Job, WriteResult, convert_file
from ..pipeline import WORKERS
from .main import human_bytes
from .options import Report, add_compression, add_output, add_report, add_selection, selection_of, span_of
from .quantities import count

EPILOG = """\
examples:
  jaka_bag convert run.bag -o run.mcap               MCAP, profile ros1, zstd
  jaka_bag convert run.mcap -o run.bag -c lz4        a bag that rosbag reads
  jaka_bag convert run.bag -o run --profile ros2     a rosbag2 folder for ROS 2
  jaka_bag convert run.bag -o small.bag -c bz2       compress (as rosbag compress -j)
  jaka_bag convert logs --jobs 4                     each .bag below logs, beside it as .mcap
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of ``jaka_bag convert``."""
    parser.add_argument("source", metavar="SRC", help=".bag or .mcap, or a folder: all of them in it")
    add_output(parser, "its suffix, .bag or .mcap, decides about the format; default: SRC with the other suffix", False)
    parser.add_argument("--profile", choices=("ros1", "ros2"), default="ros1",
                        help="ros1: messages as they are (default); ros2: a rosbag2 folder with CDR messages")
    many = parser.add_argument_group("a folder of files")
    many.add_argument("--to", choices=("mcap", "bag"), default="mcap",
                      help="format of the outputs (default mcap); files of that format are left alone")
    many.add_argument("--jobs", type=count, default=1, metavar="N", help="files at a time (default 1)")
    many.add_argument("--dask", metavar="ADDRESS", help="hand the files to the Dask scheduler there")
    add_selection(parser)
    add_compression(parser)
    add_report(parser)


def _default_target(source: Path, profile: str) -> Path:
    if profile == "ros2":
        return source.with_suffix("")
    with_suffix = {".bag": ".mcap", ".mcap": ".bag"}.get(source.suffix)
    if with_suffix is None:
        raise BagError("%s: give the output with -o" % source)
    return source.with_suffix(with_suffix)


def _job(args: argparse.Namespace, source: Path, target: Path, workers: int) -> Job:
    return Job(str(source), str(target), selection_of(args), span_of(args), args.compression, args.level,
               args.profile, args.force, workers)


def _jobs(args: argparse.Namespace, folder: Path) -> List[Job]:
    if (folder / "metadata.yaml").is_file():
        raise BagError("%s is a rosbag2 folder: ROS 2 messages are not made ROS 1 messages here (rosbags-convert does "
                       "that); its .mcap file can be filtered, merged and split" % folder)
    wanted = ".bag" if args.to == "mcap" or args.profile == "ros2" else ".mcap"
    base = Path(args.output) if args.output else folder
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


def _run_folder(args: argparse.Namespace, folder: Path, report: Report) -> int:
    jobs = _jobs(args, folder)
    results: List[WriteResult] = []

    def take(result: WriteResult) -> None:
        results.append(result)
        if result.error:
            report.tell("error", [result.error])
        else:
            report.done(_line(result))
        report.tell("note", ["%s: %s" % (result.target, note) for note in result.notes])

    from ..operations.many import convert_many, convert_on_dask

    if args.dask:
        convert_on_dask(jobs, args.dask, take)
    else:
        convert_many(jobs, max(args.jobs, 1), take)
    failed = sum(1 for result in results if result.error)
    report.finish({"files": [result.document() for result in results], "failed": failed})
    if failed:
        report.tell("error", ["%d of %d files failed" % (failed, len(jobs))])
    return 1 if failed else 0


def run(args: argparse.Namespace) -> int:
    """Convert; the exit code."""
    report = Report(args)
    source = Path(args.source)
    if source.is_dir():
        return _run_folder(args, source, report)
    if args.jobs > 1 or args.dask:
        raise UsageError("--jobs and --dask are for folders")
    target = Path(args.output) if args.output else _default_target(source, args.profile)
    job = _job(args, source, target, WORKERS)
    with report.progress(source) as progress:
        result = convert_file(job, progress)
    return report.only(_line(result), result.document(), result.notes)
