"""Logs of a fleet into a data set: speed with one and two workers, memory, bytes, and the questions of docs/fleet.md.

The logs are simulated, 2 minutes at 125 Hz with six topics; the workers are processes of this computer. A
rate counts from the moment when each worker has given a result to the last result, so the start of the cluster does not
count; nor does the making of the logs. Each number of workers has several passes in turn, and the speed-up is that of
their median times: one pass alone is off by a quarter on a shared machine. On a busy one the two workers have less than
two processors, and the speed-up shows it: "the machine alone" is the one of two processes that only compute.

    build/venv/bin/python3 test/benchmark/bench_fleet.py        1,000 logs, a quarter of an hour, 8 GB
    build/venv/bin/python3 test/benchmark/bench_fleet.py --logs 300 --keep FOLDER        a third; takes what is there

With --start the programs themselves, start included: from how many bytes on workers are done sooner than one process.

    build/venv/bin/python3 test/benchmark/bench_fleet.py --start --logs 60        some minutes
"""
import argparse
import hashlib
import multiprocessing
import resource
import shutil
import sys
import tempfile
import time
from pathlib import Path
from statistics import median
from typing import Dict, List, NamedTuple, Tuple

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tools"), str(ROOT / "test" / "support"), str(ROOT / "test" / "support" / "live"),
                str(ROOT / "test" / "support" / "logs"), str(ROOT / "test" / "benchmark")]

from bench_bags import JAKA_BAG, Cost, run  # noqa: E402
from fleet_logs import DAY_S, Run, write_run  # noqa: E402
from fleet_tasks import measured_add  # noqa: E402
from page_commands import blocks  # noqa: E402

from jaka_bag.engines.processes import Processes  # noqa: E402
from jaka_bag.engines.tasks import DONE, LogResult, LogTask, Serial, run_tasks  # noqa: E402
from jaka_fleet.dataset.adding import AddSettings, find_logs  # noqa: E402
from jaka_fleet.dataset.query import DataSet  # noqa: E402
from jaka_fleet.dataset.runs import check_version, compact  # noqa: E402
from jaka_fleet.dataset.store import open_store  # noqa: E402

CELLS = 30
LOGS_A_DAY = 3
GOAL_SPEED_UP, GOAL_MEMORY, GOAL_QUESTION_S, GOAL_GROWTH = 1.8, 300e6, 2.0, 1.1
ROUNDS = 3


def run_of(number: int, seconds: float) -> Run:
    """Return the plan of one log: cells in turn, three shifts a day, faults here and there, a joint of one cell that
    wears."""
    cell, shift = number % CELLS, number // CELLS
    return Run("cell_%02d" % cell, shift * DAY_S / LOGS_A_DAY + 7.0 * cell, int(seconds / 4) + 2, seconds=seconds,
               wear={3: 1.0 + 0.05 * shift} if cell == 4 else {}, stops=(20.0,) if number % 50 == 7 else (),
               failed=[("/plc", "out of range")] if number % 40 == 3 else (), undelivered=number % 60 == 11,
               seed=number)


def make(job: Tuple[str, int, float]) -> None:
    """Write one log."""
    folder, number, seconds = job
    write_run(Path(folder) / ("log_%04d.mcap" % number), run_of(number, seconds))


class Pass(NamedTuple):
    """One pass over all logs.

    Attributes:
        wall: Time for all logs at the rate that holds once each worker has given a result, s.
        messages: In all logs.
        memory: By worker, byte after each log.
        cpu: CPU time of the workers for the logs, s.
        own_cpu: CPU time of this process, which has the scheduler in it, from the same moment on, for all logs, s.
    """

    wall: float
    messages: int
    memory: Dict[int, List[int]]
    cpu: float
    own_cpu: float


def add(logs: List[str], target: Path, workers: int) -> Pass:
    """Add all logs; a wrong result ends the benchmark."""
    check_version(open_store(str(target)), is_to_be_made=True)
    times: List[Tuple[float, float]] = []
    results: List[LogResult] = []

    def take(result: LogResult) -> None:
        times.append((time.perf_counter(), time.process_time()))
        results.append(result)

    run_tasks(measured_add, [LogTask(path, AddSettings(str(target))) for path in logs],
              Processes(workers, "spawn") if workers else Serial(), take)
    wrong = [result for result in results if result.status != DONE]
    if wrong:
        raise SystemExit("%s: %s" % (wrong[0].path, wrong[0].reason))
    memory: Dict[int, List[int]] = {}
    begin = 0
    for number, result in enumerate(results):
        if result.value[0] not in memory:
            begin = number
        memory.setdefault(result.value[0], []).append(result.value[1])
    share = len(results) / max(len(results) - 1 - begin, 1)
    wall, own_cpu = (share * (last - first) for first, last in zip(times[begin], times[-1]))
    return Pass(wall, sum(result.messages for result in results), memory, sum(result.value[2] for result in results),
                own_cpu)


def compute(rounds: int) -> float:
    """Run rounds of work that needs a processor alone, as adding a log mostly does; return the wall time, s."""
    data = np.arange(200_000, dtype=np.float64)
    begin = time.perf_counter()
    for _ in range(rounds):
        hashlib.sha256(np.sort(np.sin(data)).tobytes()).digest()
    return time.perf_counter() - begin


def machine_speed_up() -> float:
    """Return how much more two processes compute than one, with nothing between them."""
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        pool.map(compute, [5, 5], 1)
        alone = pool.apply(compute, (200,))
        return 2.0 * alone / max(pool.map(compute, [200, 200], 1))


def size_of(folder: Path) -> int:
    """Return the bytes of all files below a folder."""
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())


def verdict(is_met: bool) -> str:
    """Return the words for a goal that is met or missed."""
    return "met" if is_met else "MISSED"


def growth_of(memory: List[int]) -> float:
    """Return the mean memory in the last tenth of a worker's logs over that in the second tenth; 1 for too few logs."""
    tenth = len(memory) // 10
    if not tenth:
        return 1.0
    return (sum(memory[-tenth:]) / tenth) / (sum(memory[tenth:2 * tenth]) / len(memory[tenth:2 * tenth]))


def show_passes(passes: Dict[int, List[Pass]], logs: int) -> bool:
    """Print the table of the passes; return whether the goals are met."""
    print("%-8s %8s %8s %16s %15s %11s %13s %10s %7s" % (
        "workers", "wall s", "logs/s", "messages/s/core", "messages/CPU s", "CPU ms/log", "own CPU ms/log", "memory MB",
        "growth"))
    is_met = True
    for workers, of_these in passes.items():
        for one in of_these:
            peak = max(max(memory) for memory in one.memory.values())
            growth = max(growth_of(memory) for memory in one.memory.values())
            is_met &= peak <= GOAL_MEMORY and growth <= GOAL_GROWTH
            print("%-8d %8.1f %8.2f %16.0f %15.0f %11.0f %14.1f %10.0f %7.2f" % (
                workers, one.wall, logs / one.wall, one.messages / one.wall / workers, one.messages / one.cpu,
                1e3 * one.cpu / logs, 1e3 * one.own_cpu / logs, peak / 1e6, growth), flush=True)
    print("memory of a worker <= %.0f MB, and at most %.2f times as much at the end as in the second tenth: %s"
          % (GOAL_MEMORY / 1e6, GOAL_GROWTH, verdict(is_met)))
    if 1 in passes and 2 in passes:
        speed_up = median(one.wall for one in passes[1]) / median(one.wall for one in passes[2])
        print("speed-up with two workers %.2f, goal %.1f: %s; the machine alone %.2f"
              % (speed_up, GOAL_SPEED_UP, verdict(speed_up >= GOAL_SPEED_UP), machine_speed_up()))
        is_met &= speed_up >= GOAL_SPEED_UP
    return is_met


def show_questions(target: Path) -> bool:
    """Print the table of the questions; return whether the goal is met. Opening the data set counts."""
    print("\n%-12s %10s %8s" % ("question", "best s", "rows"))
    is_met = True
    for block in blocks(ROOT / "docs" / "fleet.md"):
        if not block.note.startswith("the question: "):
            continue
        times = []
        for _ in range(ROUNDS):
            begin = time.perf_counter()
            with DataSet(str(target)) as data:
                rows = sum(len(batch) for batch in data.ask(block.text)[1])
            times.append(time.perf_counter() - begin)
        is_met &= min(times) <= GOAL_QUESTION_S
        print("%-12s %10.2f %8d" % (block.note.partition(": ")[2], min(times), rows), flush=True)
    print("each <= %.0f s: %s" % (GOAL_QUESTION_S, verdict(is_met)))
    return is_met


def show_start(logs: List[str], folder: Path) -> None:
    """Print wall and CPU time of the programs with the first few logs and with more, in one process and with workers.

    The best of the rounds counts; the start is in it.
    """
    print("%-18s %5s %8s" % ("", "logs", "MB"), end="")
    print("".join(" %11s %11s" % ("wall s, %d" % jobs, "CPU s, %d" % jobs) for jobs in (1, 2)))
    golden, target = logs[0], folder / "started"
    for name, words in (("dataset add", ["dataset", "add", "--to", target]),
                        ("compare --against", ["compare", golden, "--results", target, "--against"])):
        for count in sorted({count for count in (5, 10, 20, 40, len(logs)) if count <= len(logs)}):
            some = folder / "some"
            shutil.rmtree(str(some), ignore_errors=True)
            some.mkdir()
            for path in logs[:count]:
                (some / Path(path).name).symlink_to(path)
            best: Dict[int, Cost] = {}
            for _ in range(ROUNDS):
                for jobs in (1, 2):
                    shutil.rmtree(str(target), ignore_errors=True)
                    cost = run([*JAKA_BAG, *words, some, "--jobs", jobs, "-q"], (0, 1))
                    assert cost is not None
                    best[jobs] = Cost(*map(min, zip(cost, best.get(jobs, cost))))
            size = sum(Path(path).stat().st_size for path in logs[:count])
            print("%-18s %5d %8.1f" % (name, count, size / 1e6), end="")
            print("".join(" %11.2f %11.2f" % (best[jobs].wall, best[jobs].cpu) for jobs in (1, 2)), flush=True)


def main() -> int:
    """Make the logs, add them, ask; print tables. The exit code is 1 where a goal is missed."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--logs", type=int, default=1000, help="how many, default 1000")
    parser.add_argument("--seconds", type=float, default=120.0, help="length of each, default 120")
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 2], help="default 1 2")
    parser.add_argument("--keep", metavar="FOLDER", help="leave logs and data set there, and take logs that are there")
    parser.add_argument("--start", action="store_true", help="the programs, start included, with few logs and more")
    options = parser.parse_args()
    folder = Path(options.keep or tempfile.mkdtemp(prefix="bench_fleet_"))
    try:
        (folder / "logs").mkdir(parents=True, exist_ok=True)
        jobs = [(str(folder / "logs"), number, options.seconds) for number in range(options.logs)
                if not (folder / "logs" / ("log_%04d.mcap" % number)).exists()]
        with multiprocessing.get_context("spawn").Pool(2) as pool:
            for _ in pool.imap_unordered(make, jobs, 4):
                pass
        logs = find_logs([str(folder / "logs")])[:options.logs]
        print("%d logs are made" % len(logs), flush=True)
        if options.start:
            show_start(logs, folder)
            return 0
        passes: Dict[int, List[Pass]] = {workers: [] for workers in options.workers}
        for workers in ROUNDS * options.workers:
            target = folder / ("fleet_%d" % workers)
            shutil.rmtree(str(target), ignore_errors=True)
            passes[workers].append(add(logs, target, workers))
        print("%d logs of %.0f s, %d messages" % (len(logs), options.seconds, passes[options.workers[0]][0].messages))
        is_met = show_passes(passes, len(logs))
        begin = time.perf_counter()
        compact(open_store(str(target)))
        compact_s = time.perf_counter() - begin
        logs_size, target_size = sum(Path(path).stat().st_size for path in logs), size_of(target)
        print("\nbytes: %.1f MB of zstd MCAP, %.1f MB of Parquet (%.2f times); runs compacted in %.2f s, %.0f byte each"
              % (logs_size / 1e6, target_size / 1e6, target_size / logs_size, compact_s,
                 (target / "runs" / "compacted.parquet").stat().st_size / len(logs)))
        is_met &= show_questions(target)
        print("memory of this process: %.0f MB" % (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3))
        return 0 if is_met else 1
    finally:
        if not options.keep:
            shutil.rmtree(str(folder), ignore_errors=True)


if __name__ == "__main__":
    sys.exit(main())
