"""Thousands of mutations of the golden logs, each beyond the tolerances: noticed, or allowed by a named one.

    build/venv/bin/python3 test/soak/soak_golden_mutations.py [--count 2000] [--seed 1] [--jobs 2]

By hand, in about a minute. The space that they are drawn from is printed first, and told in
``test/support/logs/golden_mutations.py``. Exit code 1 where a mutation is neither noticed nor allowed; each such is
printed with its number, which with ``--only`` is made again.
"""
import argparse
import collections
import multiprocessing
import sys
import tempfile
import time
from pathlib import Path
from typing import Dict, Tuple

TEST = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TEST / "support" / "logs"), str(TEST.parent), str(TEST.parent / "tools")]

from golden_mutations import KINDS, NAMES, Fate, fate_of, golden_of  # noqa: E402


def mutated(task: Tuple[int, int]) -> Fate:
    """Make one mutation, given by seed and number, in a folder of its own."""
    with tempfile.TemporaryDirectory(prefix="soak_golden_mutations_") as folder:
        return fate_of(*task, Path(folder) / "mutated.mcap")


def print_space() -> None:
    """Print the golden logs, their topics and messages, and the kinds of mutations."""
    for name in NAMES:
        places = golden_of(name).places
        print("%-24s %5d messages: %s" % (name, sum(map(len, places.values())), ", ".join(
            "%d %s" % (len(places[topic]), topic) for topic in sorted(places))))
    print("mutations: %s; each golden log and kind in turn" % ", ".join(KINDS), flush=True)


def main() -> int:
    """Make mutations, and print how many were noticed, allowed by which tolerance, or neither."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--count", type=int, default=2000, help="mutations, default 2000")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--only", type=int, metavar="NUMBER", help="this mutation alone")
    options = parser.parse_args()
    began = time.monotonic()
    print_space()
    numbers = [options.only] if options.only is not None else range(options.count)
    verdicts: Dict[str, collections.Counter] = {kind: collections.Counter() for kind in KINDS}
    missed = 0
    with multiprocessing.get_context("spawn").Pool(options.jobs) as pool:
        for fate in pool.imap_unordered(mutated, [(options.seed, number) for number in numbers], chunksize=11):
            verdicts[fate.kind][fate.verdict] += 1
            if fate.verdict == "NEITHER" or options.only is not None:
                print("%d %s: %s: %s" % (fate.number, fate.name, fate.words,
                                         ", ".join(fate.noticed) or fate.verdict), flush=True)
            missed += fate.verdict == "NEITHER"
    for kind, counts in verdicts.items():
        print("%-5s %s" % (kind, "; ".join("%d %s" % (count, fate) for fate, count in counts.most_common())))
    print("%d mutations, seed %d, %.0f s: %d neither noticed nor named" % (
        len(numbers), options.seed, time.monotonic() - began, missed))
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
