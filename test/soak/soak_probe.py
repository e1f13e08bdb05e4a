"""Unknown arms for jaka_probe, drawn dialects of the simulated controller: is each dimension found that it can see?

    build/venv/bin/python3 test/soak/soak_probe.py [DIALECTS [FIRST [AT_ONCE]]]        100, from 0, 4 at once

The stages are those that move nothing. Each dialect takes twenty seconds, most of them waiting. Prints what is wrong or
not settled, a table by dimension, and a tally; exit code 1 where less than 98 % is right, something is wrong and not
just open, an arm moved, or was sent what no list of a stage has. For the stage that moves there is soak_probe_move.py.
"""
import collections
import concurrent.futures
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / folder) for folder in (".", "tools", "test/support", "test/support/live")]

from probe_bench import MAY_SEND, Controller, DimensionTable, facts_in, judged, probe, wrong  # noqa: E402

from jaka_ros_driver.probe.facts import DESCRIBED, ProbeStage  # noqa: E402
from jaka_ros_driver.simulation.dialect.dimension import FIRMWARE_NAMES  # noqa: E402
from jaka_ros_driver.simulation.dialect.table import Dialect  # noqa: E402

LEAST = 0.98
SEEN = {name for name, row in DESCRIBED.items() if row.dimension and row.stage is not ProbeStage.MOVE}


def run(folder, seed):
    """Probe one dialect; return what is wrong, in lines, a tally, and the judgement of each dimension."""
    firmware, out = FIRMWARE_NAMES[seed % len(FIRMWARE_NAMES)], folder / str(seed)
    arm = Controller(folder, "--dialect-seed", str(seed), "--firmware", firmware)
    done = probe(out, arm.ports, "--stage", "set", "--output", "3")
    arm.close()
    found = facts_in(out)
    mistakes = wrong(found, Dialect.from_seed(seed, firmware))
    mistakes += [] if arm.is_at_rest_throughout() else ["the arm moved"]
    mistakes += ["sent %s, which no list has" % name for name in sorted(set(arm.sent()) - MAY_SEND[ProbeStage.SET])]
    open_ones = sorted("%s (%s)" % (name, found[name].how if name in found else "never") for name in SEEN
                       if name not in found or found[name].value is None)
    lines = ["dialect %d of %s, exit code %d: wrong %s, not settled %s" % (
        seed, firmware, done.returncode, mistakes, open_ones)] if mistakes or open_ones or done.returncode else []
    return lines, {"wrong": len(mistakes), "open": len(open_ones),
                   "right": len(SEEN) - len(mistakes) - len(open_ones)}, judged(found, mistakes, SEEN)


def main():
    words = [int(word) for word in sys.argv[1:]]
    count, first, at_once = [*words, *(100, 0, 4)[len(words):]]
    tally, table = collections.Counter(), DimensionTable()
    with tempfile.TemporaryDirectory() as name, concurrent.futures.ThreadPoolExecutor(at_once) as pool:
        for lines, counts, found in pool.map(lambda seed: run(Path(name), seed), range(first, first + count)):
            tally.update(counts)
            table.add(found)
            print("".join(line + "\n" for line in lines), end="", flush=True)
    print("\n".join(table.lines()))
    share = tally["right"] / sum(tally.values())
    print("%d dialects, %d dimensions each: %d right (%.1f %%), %d not settled, %d wrong" % (
        count, len(SEEN), tally["right"], 100.0 * share, tally["open"], tally["wrong"]))
    return 0 if share >= LEAST and not tally["wrong"] else 1


if __name__ == "__main__":
    sys.exit(main())
