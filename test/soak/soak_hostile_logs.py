"""The commands on every hostile log, the heavy ones also: processor time and memory of each.

    build/venv/bin/python3 test/soak/soak_hostile_logs.py

By hand, in some minutes.
"""
import json
import subprocess
import sys
import tempfile
from pathlib import Path

TEST = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TEST / "support" / "logs"), str(TEST / "jaka_bag" / "cli"), str(TEST.parent / "tools")]

from hostile_logs import HOSTILE, MOST_BYTES, MOST_CPU_S, RUN_ALL, make  # noqa: E402
from test_hostile_logs import commands  # noqa: E402


def main() -> int:
    """Run all; return 1 where one goes beyond the bounds."""
    failed = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "out").mkdir()
        make(folder)
        for log in sorted(HOSTILE):
            for words in commands(folder / log, folder / "out"):
                call = [str(word) for word in [words[0], folder / log] + words[1:]]
                done = subprocess.run([sys.executable, "-c", RUN_ALL, json.dumps([call])], capture_output=True)
                code, seconds, most = json.loads(done.stdout.splitlines()[-1])[0] if not done.returncode else (-1, 0, 0)
                is_bad = code not in (0, 1, 2) or seconds > MOST_CPU_S or most > MOST_BYTES
                failed += is_bad
                print("%-24s %-8s exit %d  %5.1f s  %4d MB%s" % (log, words[0], code, seconds, most >> 20,
                                                               "  BEYOND THE BOUNDS" if is_bad else ""), flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
