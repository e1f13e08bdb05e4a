"""The answers of the commands about thousands of drawn logs, compared with a walk over their records.

    build/venv/bin/python3 test/soak/soak_drawn_logs.py --logs 5000

By hand, in some minutes: about 0.1 s a log. Ctrl-C and SIGTERM end it behind the log under way, whose answer does not
count: how many were walked is printed, and the exit code is 128 + the signal's number (1 where an answer differed).
"""
import argparse
import sys
import tempfile
import traceback
from collections import Counter
from pathlib import Path
from typing import Tuple

TEST = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TEST / "support" / "logs"), str(TEST.parent / "tools")]

from drawn_answers import check  # noqa: E402
from drawn_logs import draw  # noqa: E402
from early_end import EarlyEnd  # noqa: E402


def main() -> int:
    """Run all; return 1 where an answer differs, else 0, or the code of an early end."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--logs", type=int, default=5000)
    parser.add_argument("--first", type=int, default=0, help="first seed")
    args = parser.parse_args()
    ended = EarlyEnd()
    drawn: Counter[Tuple[str, str]] = Counter()
    failed = 0
    print("seeds %d to %d" % (args.first, args.first + args.logs - 1), flush=True)
    for seed in range(args.first, args.first + args.logs):
        with tempfile.TemporaryDirectory() as name:
            log = draw(seed, Path(name))
            found = ""
            try:
                check(log, seed, Path(name))
            except Exception:  # a command that answers with something else than its form is a finding, too
                found = traceback.format_exc()
            if ended.number:  # it may have reached a process of a command, too
                break
            drawn[log.path.suffix, log.lie] += 1
            if found:
                failed += 1
                print("seed %d, %s, lie %s: %s" % (seed, log.path.suffix, log.lie, found), flush=True)
        if seed % 500 == 499:
            print("up to seed %d: %d with another answer" % (seed, failed), flush=True)
    for (suffix, lie), count in sorted(drawn.items()):
        print("%-6s %-13s %5d logs" % (suffix, lie, count))
    early = "ended early by %s: " % ended.name if ended.number else ""
    print("%s%d of %d logs walked, %d with another answer" % (early, sum(drawn.values()), args.logs, failed))
    return 1 if failed else ended.exit_code if ended.number else 0


if __name__ == "__main__":
    sys.exit(main())
