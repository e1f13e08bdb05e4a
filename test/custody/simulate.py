"""Runs seeds of the custody simulation, says which of them break a rule, and how to run one of them again."""
import argparse
import gc
import multiprocessing
import os
import sys
import time
from pathlib import Path
from typing import Dict, List, NamedTuple, Optional, Tuple

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parents[1])]

from generator import Scenario, generate  # noqa: E402
from world import Result, World  # noqa: E402


class Outcome(NamedTuple):
    """One seed: what is kept of its result."""

    seed: int
    broken: str
    rule: str
    simulated: float
    moving: float
    answers: Dict[Tuple[str, str], int]
    took: float


def run_seed(seed: int) -> Outcome:
    """Run one seed without a trace."""
    began = time.process_time()
    gc.disable()  # one world does not fill the memory, and looking for its garbage takes a tenth of the time
    try:
        result = World(generate(seed)).run()
    finally:
        gc.enable()
    broken = result.broken
    return Outcome(seed, str(broken or ""), broken.rule if broken else "", result.simulated, result.moving,
                   result.answers, time.process_time() - began)


def rerun_command(seed: int) -> str:
    """How to see a seed's trace."""
    return "python3 test/custody/simulate.py --seed %d --trace" % seed


def report_one(seed: int, scenario: Scenario, result: Result) -> int:
    """The last words about one seed."""
    print("%d events, %.1f s simulated, %.1f s of motion, trace %s" % (
        len(scenario.events), result.simulated, result.moving, result.digest[:16]))
    print(result.broken or "every rule holds")
    return 1 if result.broken else 0


def shortened(scenario: Scenario) -> Scenario:
    """A scenario with as few of the events as still break the same rule."""
    rule = _rule(scenario)
    if rule is None:
        return scenario
    events = list(scenario.events)
    size = max(1, len(events) // 2)
    while True:
        position, has_shrunk = 0, False
        while position < len(events):
            fewer = events[:position] + events[position + size:]
            if _rule(_with_events(scenario, fewer)) == rule:
                events, has_shrunk = fewer, True
            else:
                position += size
        if size == 1 and not has_shrunk:
            return _with_events(scenario, events)
        size = max(1, size // 2)


def _with_events(scenario: Scenario, events: List[object]) -> Scenario:
    values = dict(vars(scenario))
    values["events"] = tuple(events)
    return Scenario(**values)


def _rule(scenario: Scenario) -> Optional[str]:
    broken = World(scenario).run().broken
    return broken.rule if broken else None


def simulate(first: int, count: int, jobs: int) -> int:
    """Run many seeds and say how they did."""
    began = time.monotonic()
    outcomes: List[Outcome] = []
    failures: List[Outcome] = []
    seeds = range(first, first + count)
    with multiprocessing.Pool(jobs) as pool:
        for outcome in pool.imap_unordered(run_seed, seeds, chunksize=5):
            outcomes.append(outcome)
            if outcome.broken:
                failures.append(outcome)
                print("seed %d: %s\n    %s" % (outcome.seed, outcome.broken, rerun_command(outcome.seed)), flush=True)
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
    simulated = sum(outcome.simulated for outcome in outcomes)
    print("%d seeds, %.2f simulated hours (%.2f of motion), %d failures, %.1f s wall time, %.0f times real time a core"
          % (count, simulated / 3600.0, sum(outcome.moving for outcome in outcomes) / 3600.0, len(failures), took,
             simulated / sum(outcome.took for outcome in outcomes)))
    return 1 if failures else 0


def main(arguments: Optional[List[str]] = None) -> int:
    """The command line."""
    parser = argparse.ArgumentParser(prog="simulate", description=__doc__)
    parser.add_argument("--seeds", type=int, default=300, metavar="N", help="how many seeds (default: %(default)s)")
    parser.add_argument("--first", type=int, default=1, metavar="S", help="the first of them (default: %(default)s)")
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
        return simulate(options.first, options.seeds, options.jobs)
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
