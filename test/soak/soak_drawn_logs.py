"""The answers of the commands about thousands of drawn logs, compared with a walk over their records.

    build/venv/bin/python3 test/soak/soak_drawn_logs.py --logs 5000

By hand, in some minutes: about 0.1 s a log.
"""
import argparse
import sys
import tempfile
from collections import Counter
from pathlib import Path
from typing import Tuple

TEST = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TEST / "support" / "logs"), str(TEST.parent / "tools")]

from drawn_answers import check  # noqa: E402
from drawn_logs import draw  # noqa: E402


def main() -> int:
    """Run all; return 1 where an answer differs."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--logs", type=int, default=5000)
    parser.add_argument("--first", type=int, default=0, help="first seed")
    args = parser.parse_args()
    drawn: Counter[Tuple[str, str]] = Counter()
    failed = 0
    for seed in range(args.first, args.first + args.logs):
        with tempfile.TemporaryDirectory() as name:
            log = draw(seed, Path(name))
            drawn[log.path.suffix, log.lie] += 1
            try:
                check(log, seed, Path(name))
            except AssertionError as error:
                failed += 1
                print("seed %d, %s, lie %s: %s" % (seed, log.path.suffix, log.lie, error), flush=True)
        if seed % 500 == 499:
            print("up to seed %d: %d with another answer" % (seed, failed), flush=True)
    for (suffix, lie), count in sorted(drawn.items()):
        print("%-6s %-13s %5d logs" % (suffix, lie, count))
    print("%d logs, %d with another answer" % (sum(drawn.values()), failed))
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
