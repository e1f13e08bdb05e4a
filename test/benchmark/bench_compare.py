"""The time of jaka_bag compare for two state logs of 30 minutes (675,000 messages each), start-up included.

The reference is `jaka_bag export` of one of them to NPZ: reading and decoding the same bytes once.

    build/venv/bin/python3 test/benchmark/bench_compare.py
"""
import argparse
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import List, Tuple

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tools"), str(ROOT / "test" / "support"), str(ROOT / "test" / "support" / "live"),
                str(ROOT / "test" / "support" / "logs")]

from command_places import command_of  # noqa: E402
from synthetic_session import Conditions, moves, simulate, write_log  # noqa: E402

JAKA_BAG = command_of("jaka_bag")


def timed(command: List[str], expected: str, rounds: int) -> Tuple[float, float]:
    """Return best wall and CPU time of a command, s; its output must contain ``expected``."""
    walls, cpus = [], []
    for _ in range(rounds):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        begin = time.perf_counter()
        done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False, cwd=str(ROOT / "tools"))
        walls.append(time.perf_counter() - begin)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        cpus.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
        if expected not in done.stdout:
            raise SystemExit("%s: %s" % (" ".join(command), done.stdout))
    return min(walls), min(cpus)


def main() -> int:
    """Make both logs, compare them, print a table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--minutes", type=float, default=30.0, help="length of each log, default 30")
    parser.add_argument("--rounds", type=int, default=5, help="the best counts, default 5")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="bench_compare_") as place:
        folder = Path(place)
        program = moves(int(options.minutes * 60 / 2.5), 0.6)
        logs = []
        for name, conditions in (("golden", Conditions()), ("same", Conditions(seed=5, start_s=1.037)),
                                 ("different", Conditions(seed=6, start_s=1.4, pace=1.02))):
            session = simulate(program, conditions)
            for keep in session.keep.values():
                keep[session.time > options.minutes * 60] = False
            session.calls = [call for call in session.calls if call.start + call.duration < options.minutes * 60 - 1]
            logs.append(str(write_log(folder / (name + ".mcap"), session)))
        rows = [("compare, same", "same: ", JAKA_BAG + ["compare", "-q", logs[0], logs[1]]),
                ("compare, different", "DIFFERENT: ", JAKA_BAG + ["compare", "-q", logs[0], logs[2]]),
                ("compare, page too", "same: ", JAKA_BAG + ["compare", "-q", logs[0], logs[1], "--force", "--html",
                                                            str(folder / "report.html")]),
                ("export one to NPZ", "", JAKA_BAG + ["export", logs[0], "-o", str(folder / "one.npz"), "--force"])]
        print("%-22s %8s %8s" % ("", "wall s", "CPU s"))
        for name, expected, command in rows:
            print("%-22s %8.2f %8.2f" % (name, *timed(command, expected, options.rounds)), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
