"""The runner of the custody simulation: runs seeds, lists those that break a rule, and how to run one of them again."""
import argparse
import gc
import hashlib
import multiprocessing
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, Dict, List, NamedTuple, Optional, Tuple

HERE = Path(__file__).resolve().parent
ALWAYS = range(1, 201)
"""Seeds that are run with every change, and never change themselves."""
NIGHT = 100_000
_DRAWN_FROM = 1_000_000
_PROGRESS_S = 60.0
sys.path[:0] = [str(folder) for folder in (HERE, HERE / "rules", HERE.parent / "support", HERE.parents[1])]

from generator import Scenario, generate  # noqa: E402
from world import Result, World  # noqa: E402


class Outcome(NamedTuple):
    """The part of a seed's result that is kept."""

    seed: int
    broken: str
    rule: str
    used: Dict[str, float]
    simulated: float
    moving: float
    answers: Dict[Tuple[str, str], int]
    took: float


def drawn_seeds(count: int = 200) -> range:
    """Return seeds that are others with every commit: nobody can mend the known ones only."""
    return range(_first_of(_state_of_the_tree()), _first_of(_state_of_the_tree()) + count)


def _first_of(text: bytes) -> int:
    return _DRAWN_FROM + int(hashlib.sha256(text).hexdigest()[:8], 16)


def _state_of_the_tree() -> bytes:
    """Return the commit's hash, or one over the tested source where there is no git."""
    root = HERE.parents[1]
    try:
        return subprocess.run(["git", "-C", str(root), "rev-parse", "HEAD"], stdout=subprocess.PIPE,
                              stderr=subprocess.DEVNULL, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        files = sorted([*(root / "jaka_ros_driver").rglob("*.py"), *HERE.glob("*.py")])
        return hashlib.sha256(b"".join([path.read_bytes() for path in files])).digest()


def run_seed(seed: int) -> Outcome:
    """Run one seed without a trace."""
    began = time.process_time()
    gc.disable()  # one world does not fill the memory, and looking for its garbage takes a tenth of the time
    try:
        result = World(generate(seed)).run()
    finally:
        gc.enable()
    broken = result.broken
    return Outcome(seed, str(broken or ""), broken.rule if broken else "", result.used, result.simulated,
                   result.moving, result.answers, time.process_time() - began)


def rerun_command(seed: int) -> str:
    """Return the command that shows a seed's trace."""
    return "python3 test/custody/simulate.py --seed %d --trace" % seed


def report_one(seed: int, scenario: Scenario, result: Result) -> int:
    """Print the result of one seed; return the exit code."""
    print("%d events, %.1f s simulated, %.1f s of motion, trace %s" % (
        len(scenario.events), result.simulated, result.moving, result.digest[:16]))
    print(result.broken or "every rule holds")
    return 1 if result.broken else 0


def shortened(scenario: Scenario) -> Scenario:
    """Return a scenario with as few of the events as still break the same rule."""
    rule = _rule(scenario)
    if rule is None:
        return scenario
    events = list(scenario.events)
    size = max(1, len(events) // 2)
    while True:
        position, has_shrunk = 0, False
        while position < len(events):
            fewer = events[:position] + events[position + size:]
            if _rule(_with(scenario, events=tuple(fewer))) == rule:
                events, has_shrunk = fewer, True
            else:
                position += size
        if size == 1 and not has_shrunk:
            return _usual_dialect(_with(scenario, events=tuple(events)), rule)
        size = max(1, size // 2)


def _usual_dialect(scenario: Scenario, rule: str) -> Scenario:
    """Return the scenario with as few non-default dialect dimensions as still break the rule."""
    for name in list(scenario.dialect):
        fewer = _with(scenario, dialect={key: value for key, value in scenario.dialect.items() if key != name})
        if _rule(fewer) == rule:
            scenario = fewer
    return scenario


def _with(scenario: Scenario, **changed: Any) -> Scenario:
    return Scenario(**dict(vars(scenario), **changed))


def _rule(scenario: Scenario) -> Optional[str]:
    broken = World(scenario).run().broken
    return broken.rule if broken else None


def told(outcome: Outcome) -> str:
    """Return the report of a failed seed: the rule, its controller's dialect, and how to run it again."""
    return "seed %d: %s\n    dialect %s\n    %s" % (
        outcome.seed, outcome.broken, generate(outcome.seed).dialect, rerun_command(outcome.seed))


def simulate(first: int, count: int, jobs: int, tells_progress: bool = False) -> int:
    """Run many seeds and print a summary; return the exit code."""
    began = time.monotonic()
    outcomes: List[Outcome] = []
    failures: List[Outcome] = []
    seeds, told_at = range(first, first + count), began
    with multiprocessing.Pool(jobs) as pool:
        for outcome in pool.imap_unordered(run_seed, seeds, chunksize=5):
            outcomes.append(outcome)
            if outcome.broken:
                failures.append(outcome)
                print(told(outcome), flush=True)
            if tells_progress and time.monotonic() - told_at > _PROGRESS_S:
                told_at = time.monotonic()
                share = len(outcomes) / count
                print("%d of %d seeds, %d failures, %.0f min to go" % (
                    len(outcomes), count, len(failures), (told_at - began) * (1.0 - share) / share / 60.0), flush=True)
    took = time.monotonic() - began
    answers: Dict[Tuple[str, str], int] = {}
    for outcome in outcomes:
        for key, number in outcome.answers.items():
            answers[key] = answers.get(key, 0) + number
    print("answers: " + ", ".join("%s %s %d" % (kind, how, number) for (kind, how), number in sorted(answers.items())))
    rules = sorted({outcome.rule for outcome in failures})
    if rules:
        print("broken rules: " + ", ".join("%s %d" % (
            rule, sum(outcome.rule == rule for outcome in failures)) for rule in rules))
    used: Dict[str, Tuple[float, int]] = {}
    for outcome in outcomes:
        for slack, amount in outcome.used.items():
            used[slack] = max(used.get(slack, (0.0, 0)), (amount, outcome.seed))
    print("slack needed at most: " + ", ".join(
        "%s %.3f s (seed %d)" % (slack, *most) for slack, most in sorted(used.items())))
    simulated = sum(outcome.simulated for outcome in outcomes)
    print("%d seeds, %.2f simulated hours (%.2f of motion), %d failures, %.1f s wall time, %.0f times real time a core"
          % (count, simulated / 3600.0, sum(outcome.moving for outcome in outcomes) / 3600.0, len(failures), took,
             simulated / sum(outcome.took for outcome in outcomes)))
    return 1 if failures else 0


def main(arguments: Optional[List[str]] = None) -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(prog="simulate", description=__doc__)
    parser.add_argument("--seeds", type=int, default=400, metavar="N", help="how many seeds (default: %(default)s)")
    parser.add_argument("--first", type=int, default=1, metavar="S", help="the first of them (default: %(default)s)")
    parser.add_argument("--night", action="store_true",
                        help="%d seeds from --first on, with a line of progress a minute" % NIGHT)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, metavar="J",
                        help="processes at a time (default: one a core)")
    parser.add_argument("--seed", type=int, metavar="S", help="run this one alone")
    parser.add_argument("--trace", action="store_true", help="with --seed: print every event and action")
    parser.add_argument("--shorten", action="store_true",
                        help="with --seed: leave out what the broken rule does not need (takes a while)")
    options = parser.parse_args(arguments)
    if options.seed is None:
        if options.trace or options.shorten:
            parser.error("--trace and --shorten need --seed")
        return simulate(options.first, NIGHT if options.night else options.seeds, options.jobs, options.night)
    scenario = generate(options.seed)
    if options.shorten:
        scenario = shortened(scenario)
    print("seed %d: %s" % (options.seed, {name: value for name, value in vars(scenario).items() if name != "events"}))
    for event in scenario.events if options.shorten else ():
        print("    " + str(event))
    result = World(scenario, on_line=print if options.trace else None).run()
    return report_one(options.seed, scenario, result)


if __name__ == "__main__":
    sys.exit(main())
