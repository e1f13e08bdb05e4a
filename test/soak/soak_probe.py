"""Unknown arms for jaka_probe, drawn dialects of the simulated controller: is each dimension found that it can see?

    build/venv/bin/python3 test/soak/soak_probe.py [DIALECTS [FIRST]]        100, from 0

Each takes six seconds, most of them waiting. Prints what is wrong or not settled, and a tally; exit code 1 where less
than 98 % is right, or something is wrong and not just open.
"""
import collections
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / folder) for folder in (".", "tools", "test/probe", "test/support")]

from test_probe import Controller, facts_in, probe, wrong  # noqa: E402

from jaka_ros_driver.probe.facts import DESCRIBED  # noqa: E402
from jaka_ros_driver.simulation.dialect.dimension import FIRMWARE_NAMES  # noqa: E402
from jaka_ros_driver.simulation.dialect.table import Dialect  # noqa: E402

LEAST = 0.98


def main():
    words = sys.argv[1:]
    count, first = int(words[0]) if words else 100, int(words[1]) if len(words) > 1 else 0
    tally = collections.Counter()
    seen = {name for name, row in DESCRIBED.items() if row.dimension}
    with tempfile.TemporaryDirectory() as name:
        for seed in range(first, first + count):
            firmware, folder = FIRMWARE_NAMES[seed % len(FIRMWARE_NAMES)], Path(name) / str(seed)
            arm = Controller(Path(name), "--dialect-seed", str(seed), "--firmware", firmware)
            done = probe(folder, arm.ports)
            arm.close()
            found = facts_in(folder)
            mistakes = wrong(found, Dialect.from_seed(seed, firmware))
            open_ones = sorted(name for name in seen if name not in found or found[name].value is None)
            tally.update(wrong=len(mistakes), open=len(open_ones), right=len(seen) - len(mistakes) - len(open_ones))
            if mistakes or open_ones or done.returncode:
                print("dialect %d of %s, exit code %d: wrong %s, not settled %s" % (
                    seed, firmware, done.returncode, mistakes, open_ones), flush=True)
    share = tally["right"] / sum(tally.values())
    print("%d dialects, %d dimensions each: %d right (%.1f %%), %d not settled, %d wrong" % (
        count, len(seen), tally["right"], 100.0 * share, tally["open"], tally["wrong"]))
    return 0 if share >= LEAST and not tally["wrong"] else 1


if __name__ == "__main__":
    sys.exit(main())
