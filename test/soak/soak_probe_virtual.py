"""Unknown arms for jaka_probe, all its stages, in virtual time: is each dimension found that its stage can see?

    build/venv/bin/python3 test/soak/soak_probe_virtual.py [DIALECTS [FIRST [AT_ONCE]]]        100, from 0, 2 at once

Each arm is a drawn dialect of the simulated controller, in one process with the probe's own stages, and takes three
seconds. Prints what is wrong or not settled, the table by dimension and by stage, and a tally. Exit code 1 where
something is wrong, less than 98 % of what can be seen is right, an arm moved before the stage move or after the end,
left its room, or was sent what no list of a stage has. With real processes there is soak_probe_move.py.
"""
import concurrent.futures
import contextlib
import io
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / folder) for folder in (".", "tools", "test/support", "test/support/live", "test/probe")]

from probe_bench import MAY_SEND, DimensionTable, drawn, judged, left_room, wrong  # noqa: E402
from virtual_probe import probed  # noqa: E402

from jaka_ros_driver.probe.facts import DESCRIBED, ProbeStage  # noqa: E402

LEAST = 0.98
SEEN = [name for name, row in DESCRIBED.items() if row.dimension]
REST_S = 3.0


def complaints(bench):
    """Return what an arm did, or was sent, that it must not; time goes on for long enough that it could move again."""
    found = [] if len(set(bench.path[:bench.before_move])) == 1 else ["the arm moved before the stage move"]
    if ProbeStage.MOVE not in bench.stages:
        found.append("the stage move was left out")
    ended = len(bench.path)
    bench.sleep(bench.dialect.start_delay + REST_S)
    found += ["the arm moved after the end"] if len(set(bench.path[ended - 1:])) > 1 else []
    found += left_room(bench.path)
    return found + sorted({"in %s was sent %s, which no list has" % (stage.value, name)
                           for stage, name in bench.sent if name not in MAY_SEND[stage]})


def run(seed):
    """Probe one dialect; return what is wrong or open, in lines, how many complaints, and the judgements."""
    firmware, dialect = drawn(seed)
    with contextlib.redirect_stdout(io.StringIO()):
        bench, facts = probed(dialect, firmware, ProbeStage.MOVE, 3, fits=True)
    mistakes, bad = wrong(facts, dialect), complaints(bench)
    verdicts = judged(facts, mistakes, SEEN, dialect)
    lines = ["dialect %d of %s: %s" % (seed, firmware, line) for line in [
        *bad, *("%s is %s, and %s was found" % (name, true, value) for name, value, true in mistakes),
        *("%s is not settled: %s" % (name, facts[name].how if name in facts else "it was not looked for")
          for name, verdict in verdicts.items() if verdict == "open")]]
    return lines, len(bad), verdicts


def main():
    words = [int(word) for word in sys.argv[1:]]
    count, first, at_once = [*words, *(100, 0, 2)[len(words):]]
    table, bad = DimensionTable(), 0
    with concurrent.futures.ProcessPoolExecutor(at_once) as pool:
        for lines, number, verdicts in pool.map(run, range(first, first + count)):
            bad += number
            table.add(verdicts)
            print("".join(line + "\n" for line in lines), end="", flush=True)
    print("\n".join(table.lines()))
    right, mistaken, still_open = table.sums(SEEN)
    share = right / (right + mistaken + still_open)
    print("%d dialects: %.2f %% right, %d wrong, %d not settled; %d complaints about what the arms did" % (
        count, 100.0 * share, mistaken, still_open, bad))
    return 0 if share >= LEAST and not mistaken and not bad else 1


if __name__ == "__main__":
    sys.exit(main())
