"""False alarms: golden logs are replayed again and again on a loaded computer; an unchanged run must never differ.

    build/venv/bin/python3 test/soak/soak_golden_logs.py [--runs 50] [--load 2] [NAME ...]        in the devel space

Prints a line for each run, how near each kind of check came to its limit, and a tally; exit code 1 when a run differed.
The reports of runs that differed stay.
"""
import argparse
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tools")]

from jaka_regression.replay import replay  # noqa: E402 - the checkout, wherever it is started from
from jaka_ros_driver.errors import JakaError  # noqa: E402

FOLDER = ROOT / "test" / "data" / "golden"


def main() -> int:
    """Replay golden logs, and count the verdicts."""
    names = sorted(path.stem for path in FOLDER.glob("*.mcap"))
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help="of golden logs; default: all in turn")
    parser.add_argument("--runs", type=int, default=50, help="in all, default 50")
    parser.add_argument("--load", type=int, default=2, help="busy processes beside, default 2")
    options = parser.parse_args()
    chosen = options.names or names
    for number in (signal.SIGINT, signal.SIGTERM):  # also where a shell has it ignored: no program is to stay behind
        signal.signal(number, signal.default_int_handler)
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(options.load)]
    tally = {"same": 0, "different": 0, "failed": 0}
    worst = {}
    place = Path(tempfile.mkdtemp(prefix="soak_golden_"))
    try:
        for number in range(options.runs):
            name = chosen[number % len(chosen)]
            folder = place / ("%03d_%s" % (number + 1, name))
            begin = time.monotonic()
            try:
                result = replay(FOLDER / (name + ".mcap"), folder)
                outcome, words = ("same", "") if result.same else ("different", result.summary)
                for check in result.comparison.checks:
                    if check.measured is not None and check.limit:
                        worst[check.aspect] = max(worst.get(check.aspect, (0.0,)),
                                                 (check.measured / check.limit, check.measured, check.unit, name))
            except JakaError as error:
                outcome, words = "failed", str(error)
            tally[outcome] += 1
            if outcome == "same":
                shutil.rmtree(str(folder))
            print("%3d %-18s %-9s %5.1f s, load %.1f" % (number + 1, name, outcome, time.monotonic() - begin,
                                                         os.getloadavg()[0]), flush=True)
            if words:
                print(words, flush=True)
    finally:
        for process in busy:
            process.kill()
            process.wait()
    for stage, (share, measured, unit, name) in sorted(worst.items(), key=lambda entry: -entry[1][0]):
        print("%-14s at most %3.0f %% of the limit: %.4g %s in %s" % (stage.value, 100.0 * share, measured, unit, name))
    print("%d runs: %s; %d busy processes beside, %d processors" % (
        options.runs, ", ".join("%d %s" % (count, outcome) for outcome, count in tally.items()), options.load,
        os.cpu_count() or 1))
    if tally["same"] == options.runs:
        shutil.rmtree(str(place))
        return 0
    print("what differed is in %s" % place)
    return 1


if __name__ == "__main__":
    sys.exit(main())
