"""The growth of time and memory of jaka_bag with the length of a log: 30 minutes, and 8 hours (10.8 million messages).

Every command is a process of its own, start-up included; memory is the peak of its resident set. The logs are of
simulated motions, the same in every run; making those of 8 h takes some minutes and 1.3 GB of disk. "x" is the ratio
to 30 minutes; the goals are stated for 8 h.

    build/venv/bin/python3 test/benchmark/bench_scale.py
"""
import argparse
import os
import shutil
import sys
import tempfile
from pathlib import Path
from typing import Dict, List, NamedTuple, Optional, Sequence

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tools"), str(ROOT / "test" / "support"), str(ROOT / "test" / "support" / "logs"),
                str(ROOT / "test" / "benchmark")]

from bench_bags import JAKA_BAG, Cost, remove, run  # noqa: E402
from synthetic_session import Conditions, write_long_log  # noqa: E402

from jaka_bag.containers.registry import open_log  # noqa: E402

SHORT_MINUTES = 30.0


class Case(NamedTuple):
    """One command on logs of one length, its outputs, and the goals for the long ones (None: none).

    Attributes:
        memory_mb: At most, MB.
        ratio: At most so many times the time of the short logs.
        per_s: At least so many messages a second.
    """

    name: str
    command: Sequence[object]
    outputs: Sequence[Path] = ()
    memory_mb: Optional[float] = None
    ratio: Optional[float] = None
    per_s: Optional[float] = None


def cases(golden: Path, candidate: Path, folder: Path) -> List[Case]:
    """Return the commands."""
    out = folder / "out"
    tables = [out / ("run_jaka_driver_%s.parquet" % name)
              for name in ("joint_position", "robot_states", "service_calls", "tool_position")]
    return [
        Case("compare", JAKA_BAG + ["compare", "-q", golden, candidate], [], 400, 16.8),
        Case("compare --html", JAKA_BAG + ["compare", "-q", golden, candidate, "--html", out / "report.html"],
             [out / "report.html"]),
        Case("plot", JAKA_BAG + ["plot", golden, "-o", out / "run.svg"], [out / "run.svg"], 300),
        Case("export to Parquet", JAKA_BAG + ["export", golden, "-o", out / "run.parquet"], tables, 200, None, 1e6),
        Case("info --freq", JAKA_BAG + ["info", "--freq", golden], [], 100),
        Case("convert", JAKA_BAG + ["convert", "-q", golden, "-o", out / "run.bag"], [out / "run.bag"])]


def measured(some: Sequence[Case], rounds: int) -> Dict[str, Cost]:
    """Return the best round of each case."""
    best: Dict[str, Cost] = {}
    for _ in range(rounds):
        for case in some:
            remove(case.outputs)
            cost = run(case.command)
            remove(case.outputs)
            if cost is not None:
                best[case.name] = Cost(*map(min, zip(cost, best.get(case.name, cost))))
    return best


def verdict(case: Case, cost: Cost, ratio: float, count: int) -> str:
    """Return the goals, and whether they are met."""
    goals = [("%.0f MB" % (case.memory_mb or 0), case.memory_mb is None or cost.memory / 1e6 <= case.memory_mb,
              case.memory_mb),
             ("%.3g x" % (case.ratio or 0), case.ratio is None or ratio <= case.ratio, case.ratio),
             ("%.0f msg/s" % (case.per_s or 0), case.per_s is None or count / cost.wall >= case.per_s, case.per_s)]
    return ", ".join("%s %s" % (text, "ok" if is_met else "MISSED") for text, is_met, goal in goals if goal is not None)


def main() -> int:
    """Make the logs, run everything, print a table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--hours", type=float, default=8.0, help="length of the long logs, default 8")
    parser.add_argument("--rounds", type=int, default=2, help="the best counts, default 2")
    parser.add_argument("--only", default="", help="run commands whose name holds this word")
    parser.add_argument("--folder", help="where to work (default: where temporary files go)")
    parser.add_argument("--keep", metavar="FOLDER", help="keep the logs there, and use those that are there")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=options.folder, prefix="bench_scale.") as name:
        folder = Path(name)
        (folder / "out").mkdir()
        place = Path(options.keep or name)
        place.mkdir(parents=True, exist_ok=True)
        results = []
        for minutes in (SHORT_MINUTES, 60.0 * options.hours):
            logs = [place / ("%s_%g.mcap" % (kind, minutes)) for kind in ("golden", "candidate")]
            for log, conditions in zip(logs, (Conditions(), Conditions(seed=5, start_s=1.4))):
                if not log.exists():
                    write_long_log(log, 60.0 * minutes, conditions)
            with open_log(logs[0]) as reader:
                count = reader.message_count
            some = [case for case in cases(*logs, folder) if options.only in case.name]
            results.append((some, measured(some, options.rounds), count))
        free_gb = shutil.disk_usage(str(place)).free / 1e9
    (_, short, short_count), (some, long, count) = results
    print("%g min, %d messages, and %g h, %d messages; %d cores, load %.1f, %.0f GB free" % (
        SHORT_MINUTES, short_count, options.hours, count, os.cpu_count() or 0, os.getloadavg()[0], free_gb))
    print("%-20s %9s %9s %9s %9s %7s %7s %9s %9s %10s  %s" % (
        "", "wall s", "wall s", "CPU s", "CPU s", "x wall", "x CPU", "MB", "MB", "msg/s", "goals"))
    for case in some:
        if case.name in short and case.name in long:
            a, b = short[case.name], long[case.name]
            print("%-20s %9.2f %9.2f %9.2f %9.2f %7.1f %7.1f %9.0f %9.0f %10.0f  %s" % (
                case.name, a.wall, b.wall, a.cpu, b.cpu, b.wall / a.wall, b.cpu / a.cpu, a.memory / 1e6,
                b.memory / 1e6, count / b.wall, verdict(case, b, b.wall / a.wall, count)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
