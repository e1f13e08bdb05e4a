"""False alarms: golden logs are replayed again and again on a loaded computer; an unchanged run must never differ.

    build/venv/bin/python3 test/soak/soak_golden_logs.py [--runs 50] [--load 2] [--learn 10] [NAME ...]

In the devel space. Every second run has the busy processes of ``--load`` beside it. With ``--learn`` that many runs of
each golden log come first, and the others are judged by the tolerances that these teach.

A teaching run that differs by the usual tolerances, or fails, teaches nothing, and another one is made; after three
times as many as are wanted the soak ends.

Prints a line for each run, how near each kind of check came to its limit, and a tally; exit code 1 when more than one
judged run in a hundred (one is allowed to fewer) differed or failed. The reports of runs that differed stay.
"""
import argparse
import itertools
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

from jaka_bag.compare.audit.auditing import audit, summary  # noqa: E402 - the checkout, wherever it is started from
from jaka_bag.compare.learning import learn  # noqa: E402
from jaka_regression.replay import replay  # noqa: E402
from jaka_regression.scenario import scenario_of  # noqa: E402
from jaka_ros_driver.errors import JakaError  # noqa: E402

FOLDER = ROOT / "test" / "data" / "golden"


def main() -> int:
    """Replay golden logs, and count the verdicts."""
    names = sorted(path.stem for path in FOLDER.glob("*.mcap"))
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help="of golden logs; default: all in turn")
    parser.add_argument("--runs", type=int, default=50, help="in all, default 50")
    parser.add_argument("--load", type=int, default=2, help="busy processes beside each second run, default 2")
    parser.add_argument("--learn", type=int, default=0, metavar="N", help="good runs of each log to learn from first")
    options = parser.parse_args()
    chosen = options.names or names
    for number in (signal.SIGINT, signal.SIGTERM):  # also where a shell has it ignored: no program is to stay behind
        signal.signal(number, signal.default_int_handler)
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(options.load)]
    tally = {"same": 0, "different": 0, "failed": 0}
    worst = {}
    good, lessons = {name: [] for name in chosen}, dict.fromkeys(chosen, 0)
    taught = {}
    place = Path(tempfile.mkdtemp(prefix="soak_golden_"))
    try:
        for number in itertools.count():
            if sum(tally.values()) == options.runs:
                break
            name = chosen[number % len(chosen)]
            folder = place / ("%03d_%s" % (number + 1, name))
            golden, is_lesson = FOLDER / (name + ".mcap"), len(good[name]) < options.learn
            if is_lesson and lessons[name] == 3 * options.learn:
                print("%s: %d of %d teaching runs are good: it cannot be learned from" % (
                    name, len(good[name]), lessons[name]))
                return 1
            lessons[name] += is_lesson
            is_busy = number // len(chosen) % 2 == 1
            for process in busy:
                process.send_signal(signal.SIGCONT if is_busy else signal.SIGSTOP)
            begin = time.monotonic()
            try:
                if options.learn and not is_lesson and name not in taught:
                    taught[name] = learn(golden, good[name], scenario_of(golden).tolerances).tolerances
                    found = audit(golden, taught[name])
                    print("%s: learned from %d runs; %s" % (name, len(good[name]), summary(found)), flush=True)
                result = replay(golden, folder, taught.get(name))
                outcome, words = ("same", "") if result.same else ("different", result.summary)
                if is_lesson and result.same:
                    good[name].append(shutil.move(str(folder / "candidate.mcap"), str(place / (folder.name + ".mcap"))))
                    outcome = "good"
                for check in result.comparison.checks:
                    if check.measured is not None and check.limit:
                        worst[check.aspect] = max(worst.get(check.aspect, (0.0,)),
                                                 (check.measured / check.limit, check.measured, check.unit, name))
            except JakaError as error:
                outcome, words = "failed", str(error)
            if not is_lesson:
                tally[outcome] += 1
            if outcome in ("same", "good"):
                shutil.rmtree(str(folder))
            beside = ", beside %d busy processes" % len(busy) if is_busy else ""
            took = time.monotonic() - begin
            print("%3d %-18s %-9s %5.1f s%s" % (number + 1, name, outcome, took, beside), flush=True)
            if words:
                print(words, flush=True)
    finally:
        for process in busy:
            process.kill()
            process.wait()
    for stage, (share, measured, unit, name) in sorted(worst.items(), key=lambda entry: -entry[1][0]):
        print("%-14s at most %3.0f %% of the limit: %.4g %s in %s" % (stage.value, 100.0 * share, measured, unit, name))
    print("%d runs: %s; %d busy processes beside each second one, %d processors" % (
        options.runs, ", ".join("%d %s" % (count, outcome) for outcome, count in tally.items()), options.load,
        os.cpu_count() or 1))
    bad = options.runs - tally["same"]
    if any(path.is_dir() for path in place.iterdir()):
        print("what differed is in %s" % place)
    else:
        shutil.rmtree(str(place))
    return 1 if bad > max(1, options.runs // 100) else 0


if __name__ == "__main__":
    sys.exit(main())
