"""All stages of jaka_probe on unknown arms: does the arm rest however and whenever the probe is ended, is it right?

    build/venv/bin/python3 test/soak/soak_probe_move.py [KILLS [DIALECTS [FIRST [AT_ONCE]]]]        20, 10, 0 and 4

KILLS runs are ended at a random moment of the whole run: killed, frozen for good, by SIGTERM or by Ctrl-C; how long a
run takes, one in virtual time tells. Then the arm is watched until nothing that it was sent could still begin, and its
own log is judged. DIALECTS runs go to their end, and what they found is compared. Each run is a drawn dialect of the
simulated controller and takes one to ten minutes, most of it waiting: 4 minutes in the mean, and half of that where it
is ended. ``soak_probe_move.py 200 0 0 6`` ends 200 runs and nothing else.

Prints a row for each run that was ended, and a table of where; of the whole ones what is wrong or not settled, a table
by dimension, how far each twin is from its arm, and a tally. Exit code 1 where an arm did not rest, left its room or
was sent what no list of a stage has, something is wrong and not just open, a stated error of the twin does not hold, or
less than 98 % is right. Whether acceleration and jerk show is a matter of feed and host: open, these two do not count.
A run that ends before its moment, as on a busy host, is judged, printed and repeated; after the third time it fails.
"""
import collections
import concurrent.futures
import contextlib
import io
import multiprocessing
import random
import re
import signal
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / folder) for folder in (".", "tools", "test/support", "test/support/live", "test/probe")]

from probe_bench import (  # noqa: E402
    MAY_SEND,
    Controller,
    DimensionTable,
    ProbeOnTerminal,
    can_see,
    command,
    drawn,
    facts_in,
    judged,
    left_room,
    wrong,
)
from twin_check import missed, way_back  # noqa: E402
from virtual_probe import probed  # noqa: E402
from wire_verdict import WireVerdict  # noqa: E402

from jaka_ros_driver.probe.facts import DESCRIBED, Fact, ProbeStage  # noqa: E402

LEAST = 0.98
STOPPED_WITHIN_S = 4.0
WATCHED_S = 6.0
ENDS_WITHIN_S = 60.0
"""Longest time, s, in which a probe that was not killed writes its report and ends."""
TRIES = 3
MAY_BE_OPEN = {"move_acceleration", "move_jerk_time"}
OUTPUT = 3
WORDS = ("--stage", "move", "--program", "weld", "--output", str(OUTPUT))
ENDINGS = (signal.SIGKILL, signal.SIGSTOP, signal.SIGTERM, signal.SIGINT)


def start(folder, seed):
    firmware, dialect = drawn(seed)
    arm = Controller(folder, "--dialect-seed", str(seed), "--firmware", firmware)
    arm.operate("load_program", name="weld")
    return arm, dialect


def complaints(arm, ended):
    """Return what the arm's own log has against a run."""
    verdict = WireVerdict(arm.log)
    found = left_room([joints for _, joints in verdict.joints()])
    rest = verdict.rest_after(ended - 60.0)
    if rest > ended + STOPPED_WITHIN_S:
        found.append("moved until %.1f s after the end" % (rest - ended))
    return found + ["was sent %s, which no list has" % name
                    for name in sorted(set(arm.sent()) - MAY_SEND[ProbeStage.MOVE])]


# ---- runs that are ended ----

def length(seed):
    """Return how long a run on this dialect takes in virtual time, s: a real one takes longer."""
    firmware, dialect = drawn(seed)
    with contextlib.redirect_stdout(io.StringIO()):
        bench, _ = probed(dialect, firmware, ProbeStage.MOVE, OUTPUT)
    return bench.now - bench.begun


def place_of(text):
    """Return the stage, or the step of the stage that moves, in which a probe is that has printed this."""
    found = re.findall(r"^jaka_probe: +(?:(look|ask|set|move):|(step \d+) of)", text, re.MULTILINE)
    return "".join(found[-1]) if found else "before look"


def killed(folder, seed, seconds):
    """End a run at a random moment of so many seconds; return what is wrong, where, and how often it ended early.

    The place is "" where it ended before its moment each time.
    """
    chance, bad = random.Random(seed), []
    for early in range(TRIES):
        number, moment = chance.choice(ENDINGS), chance.uniform(0.0, seconds)
        why, place = killed_once(folder, seed, number, moment, seconds, early)
        bad += why
        if place:
            return bad, place, early
    return [*bad, "dialect %d: ended before its moment %d times: is this host too busy?" % (seed, TRIES)], "", TRIES


def killed_once(folder, seed, number, moment, seconds, early):
    """End one run; return what is wrong, and where it was, "" where it had ended before."""
    arm, dialect = start(folder, seed)
    began = time.monotonic()
    terminal = ProbeOnTerminal(command(folder / ("killed-%d-%d" % (seed, early)), arm.ports, *WORDS), arm=arm)
    told = "dialect %d, %s after %.1f s of %.0f s" % (seed, number.name, moment, seconds)
    while time.monotonic() < began + moment and terminal.process.poll() is None:
        time.sleep(0.05)
    place = place_of(terminal.text) if terminal.process.poll() is None else ""
    terminal.process.send_signal(number)
    ended = time.monotonic()
    time.sleep(WATCHED_S + dialect.start_delay)  # a move that waits to begin must not begin either
    found = []
    if place and number in (signal.SIGTERM, signal.SIGINT):
        while terminal.process.poll() is None and time.monotonic() < ended + ENDS_WITHIN_S:
            time.sleep(0.05)
        found += ["had not ended after %.0f s" % ENDS_WITHIN_S] if terminal.process.poll() is None else []
    terminal.process.kill()
    terminal.end()
    arm.close()
    found += complaints(arm, ended)
    reasons = [line for line in terminal.text.splitlines() if re.search("ended|left out|not seen", line)]
    print("%s, %s: %s" % (told, "in %s" % place if place else "ended early: %s" % " / ".join(reasons or ["no reason"]),
                          "; ".join(found) or "at rest"), flush=True)
    return ["%s, in %s: %s" % (told, place or "a run that ended early", why) for why in found], place


def all_killed(folder, seeds, at_once):
    """End a run of each of these seeds; return what is wrong. Prints where they were ended."""
    bad, places, repeated = [], collections.Counter(), 0
    with concurrent.futures.ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as virtual, \
            concurrent.futures.ThreadPoolExecutor(at_once) as pool:
        def one(seed):
            return killed(folder, seed, virtual.submit(length, seed).result())
        for why, place, early in pool.map(one, seeds):
            bad += why
            places[place or "none: ended early each time"] += 1
            repeated += early
    print("| ended in | runs |\n| --- | --- |")
    for place, count in sorted(places.items(), key=lambda row: [word.zfill(2) for word in row[0].split()]):
        print("| %s | %d |" % (place, count))
    print("%d runs ended before their moment and were repeated" % repeated, flush=True)
    return bad


# ---- whole runs ----

def whole(folder, seed):
    """Run to the end; return what is wrong, a tally, complaints, the judgements by dimension, and the twin's error."""
    arm, dialect = start(folder, seed)
    out = folder / ("whole-%d" % seed)
    terminal = ProbeOnTerminal(command(out, arm.ports, *WORDS), arm=arm)
    code = terminal.end()
    ended = time.monotonic()
    arm.close()
    found = facts_in(out)
    seen = [name for name, row in DESCRIBED.items() if row.dimension]
    mistakes = wrong(found, dialect)
    if found.get("twin_angle", Fact(None, "")).value is not None:
        mistakes += [("twin", why, "stated") for why in missed(way_back(dialect), found, drawn(seed)[0])]
    table = judged(found, mistakes, seen, dialect)
    open_ones = ["%s (%s)" % (name, found[name].how if name in found else "never") for name in seen
                 if table[name] == "open" and name not in MAY_BE_OPEN and can_see(name, dialect)]
    lines = ["dialect %d, exit code %d: wrong %s, not settled %s" % (seed, code, mistakes, open_ones)
             ] if mistakes or open_ones or code else []
    tally = {"wrong": len(mistakes), "open": len(open_ones), "right": sum(one == "right" for one in table.values())}
    return lines, tally, ["dialect %d: %s" % (seed, why) for why in complaints(arm, ended)], table, twin_error(
        seed, found)


def twin_error(seed, found):
    """Return the line that says how far the twin of these facts is from this dialect's arm, by the report."""
    angle, seconds = (found.get(name, Fact(None, "the stage did not run")) for name in ("twin_angle", "twin_time"))
    if angle.value is None or seconds.value is None:
        return "dialect %d: twin not settled, %s" % (seed, angle.how)
    return "dialect %d: twin within %.3f deg and %.0f ms" % (seed, angle.value, 1000.0 * seconds.value)


def main():
    signal.signal(signal.SIGINT, signal.default_int_handler)  # the probe inherits one that is ignored
    words = [int(word) for word in sys.argv[1:]]
    kills, dialects, first, at_once = [*words, *(20, 10, 0, 4)[len(words):]]
    tally, bad, table, errors = collections.Counter(), [], DimensionTable(), []
    with tempfile.TemporaryDirectory() as name, concurrent.futures.ThreadPoolExecutor(at_once) as pool:
        if kills:
            bad += all_killed(Path(name), range(first, first + kills), at_once)
        for lines, counts, why, found, error in pool.map(
                lambda seed: whole(Path(name), seed), range(first, first + dialects)):
            tally.update(counts)
            table.add(found)
            errors.append(error)
            bad += why
            print("\n".join(lines + why) or "right", flush=True)
    print("\n".join([*(table.lines() if dialects else []), *errors, *bad]))
    share = tally["right"] / max(1, sum(tally.values()))
    print("%d ended, %d whole: %d complaints about arms and runs; %d right (%.1f %%), %d not settled, %d wrong" % (
        kills, dialects, len(bad), tally["right"], 100.0 * share, tally["open"], tally["wrong"]))
    return 1 if bad or tally["wrong"] or (dialects and share < LEAST) else 0


if __name__ == "__main__":
    sys.exit(main())
