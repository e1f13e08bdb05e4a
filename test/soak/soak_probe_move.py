"""The stage move of jaka_probe on unknown arms: is it right, and does the arm rest however and whenever it is ended?

    build/venv/bin/python3 test/soak/soak_probe_move.py [KILLS [DIALECTS [FIRST [AT_ONCE]]]]        20, 10, 0 and 4

KILLS runs are ended at a random moment of a random step: killed, frozen for good, by SIGTERM or by Ctrl-C. DIALECTS
runs go to their end, and what they found is compared. Each run is a drawn dialect of the simulated controller and takes
one minute, most of it waiting; with the longest start delays it takes five. Prints what is wrong or not settled, a
table by dimension, how far each twin is from its arm, and a tally. Exit code 1 where an arm did not rest, left its room
or was sent what no list of a stage has, something is wrong and not just open, a stated error of the twin does not hold,
or less than 98 % is right. Whether acceleration and jerk show is a matter of the feed: open, these two do not count. A
run that ends before its moment, as on a busy host, is printed, and judged by the arm's own log all the same.
"""
import collections
import concurrent.futures
import math
import random
import signal
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / folder) for folder in (".", "tools", "test/support", "test/support/live")]

from probe_bench import MAY_SEND, Controller, DimensionTable, ProbeOnTerminal, command, facts_in, judged, wrong  # noqa: E402
from twin_check import missed, way_back  # noqa: E402
from wire_verdict import WireVerdict  # noqa: E402

from jaka_ros_driver.kinematics.arm_models import load_model  # noqa: E402
from jaka_ros_driver.kinematics.forward import forward  # noqa: E402
from jaka_ros_driver.probe.facts import DESCRIBED, Fact, ProbeStage  # noqa: E402
from jaka_ros_driver.probe.motion import ROOM_M, ROOM_RAD  # noqa: E402
from jaka_ros_driver.probe.move import STEPS  # noqa: E402
from jaka_ros_driver.simulation.dialect.dimension import FIRMWARE_NAMES  # noqa: E402
from jaka_ros_driver.simulation.dialect.table import Dialect  # noqa: E402

LEAST = 0.98
STOPPED_WITHIN_S = 4.0
WATCHED_S = 6.0
MAY_BE_OPEN = {"move_acceleration", "move_jerk_time"}
MODEL = "zu7"
WORDS = ("--stage", "move", "--program", "weld")
ENDINGS = (signal.SIGKILL, signal.SIGSTOP, signal.SIGTERM, signal.SIGINT)


def start(folder, seed):
    firmware = FIRMWARE_NAMES[seed % len(FIRMWARE_NAMES)]
    arm = Controller(folder, "--dialect-seed", str(seed), "--firmware", firmware)
    arm.operate("load_program", name="weld")
    return arm, Dialect.from_seed(seed, firmware)


def complaints(arm, ended):
    """Return what the arm's own log has against a run."""
    verdict = WireVerdict(arm.log)
    path = verdict.joints()
    start_joints = path[0][1]
    furthest = max(abs(a - b) for _, joints in path for a, b in zip(joints, start_joints))
    found = [] if furthest <= ROOM_RAD else ["a joint went %.2f deg" % math.degrees(furthest)]
    model = load_model(MODEL)
    start_flange = forward(model, start_joints)[9:]
    away = max(math.dist(forward(model, joints)[9:], start_flange) for joints in {joints for _, joints in path})
    found += [] if away <= ROOM_M else ["the flange was %.0f mm from its start" % (1000.0 * away)]
    rest = verdict.rest_after(ended - 60.0)
    if rest > ended + STOPPED_WITHIN_S:
        found.append("moved until %.1f s after the end" % (rest - ended))
    found += ["was sent %s, which no list has" % name for name in sorted(set(arm.sent()) - MAY_SEND[ProbeStage.MOVE])]
    return found


def killed(folder, seed):
    """Run with an end at a random moment; return what is wrong."""
    chance = random.Random(seed)
    number, step, moment = chance.choice(ENDINGS), chance.randrange(1, len(STEPS) + 1), chance.uniform(0.0, 4.0)
    arm, dialect = start(folder, seed)
    terminal = ProbeOnTerminal(command(folder / ("killed-%d" % seed), arm.ports, *WORDS), arm=arm)
    try:
        terminal.wait_for("step %d of" % step)
    except AssertionError as error:  # the program has ended before
        print("dialect %d ended early, before step %d: %s" % (seed, step, str(error)[-300:]), flush=True)
        terminal.end()
        ended = time.monotonic()
        time.sleep(WATCHED_S)
        arm.close()
        return ["dialect %d, ended early: %s" % (seed, why) for why in complaints(arm, ended)]
    time.sleep(moment + chance.choice((0.0, dialect.start_delay)))
    terminal.process.send_signal(number)
    ended = time.monotonic()
    time.sleep(WATCHED_S)
    terminal.process.kill()
    terminal.end()
    arm.close()
    return ["dialect %d, %s in step %d after %.2f s: %s" % (seed, number.name, step, moment, why)
            for why in complaints(arm, ended)]


def whole(folder, seed):
    """Run to the end; return what is wrong, a tally, complaints, the judgements by dimension, and the twin's error."""
    arm, dialect = start(folder, seed)
    out = folder / ("whole-%d" % seed)
    terminal = ProbeOnTerminal(command(out, arm.ports, *WORDS), arm=arm)
    code = terminal.end()
    ended = time.monotonic()
    arm.close()
    found = facts_in(out)
    seen = [name for name, row in DESCRIBED.items() if row.dimension and row.stage is ProbeStage.MOVE]
    mistakes = wrong({name: found[name] for name in seen if name in found}, dialect)
    if found.get("twin_angle", Fact(None, "")).value is not None:
        mistakes += [("twin", why, "stated") for why in missed(
            way_back(dialect), found, FIRMWARE_NAMES[seed % len(FIRMWARE_NAMES)])]
    table = judged(found, mistakes, seen)
    may_be_open = MAY_BE_OPEN | (set() if dialect.knows("set_network_exception_handle") else {"link_loss_notice"})
    seen = [name for name in seen if name not in may_be_open or found.get(name, Fact(None, "")).value is not None]
    open_ones = ["%s (%s)" % (name, found[name].how if name in found else "never") for name in seen
                 if name not in found or found[name].value is None]
    lines = ["dialect %d, exit code %d: wrong %s, not settled %s" % (seed, code, mistakes, open_ones)
             ] if mistakes or open_ones or code else []
    tally = {"wrong": len(mistakes), "open": len(open_ones), "right": len(seen) - len(mistakes) - len(open_ones)}
    return lines, tally, ["dialect %d: %s" % (seed, why) for why in complaints(arm, ended)], table, twin_error(
        seed, found)


def twin_error(seed, found):
    """Return the line that says how far the twin of these facts is from this dialect's arm, by the report."""
    angle, seconds = (found.get(name, Fact(None, "the stage did not run")) for name in ("twin_angle", "twin_time"))
    if angle.value is None or seconds.value is None:
        return "dialect %d: twin not settled, %s" % (seed, angle.how)
    return "dialect %d: twin within %.3f deg and %.0f ms" % (seed, angle.value, 1000.0 * seconds.value)


def main():
    words = [int(word) for word in sys.argv[1:]]
    kills, dialects, first, at_once = [*words, *(20, 10, 0, 4)[len(words):]]
    tally, bad, table, errors = collections.Counter(), [], DimensionTable(), []
    with tempfile.TemporaryDirectory() as name, concurrent.futures.ThreadPoolExecutor(at_once) as pool:
        ends = [pool.submit(killed, Path(name), first + seed) for seed in range(kills)]
        wholes = [pool.submit(whole, Path(name), first + seed) for seed in range(dialects)]
        for run in ends:
            bad += run.result()
            print("\n".join(run.result()) or "at rest", flush=True)
        for run in wholes:
            lines, counts, why, found, error = run.result()
            tally.update(counts)
            table.add(found)
            errors.append(error)
            bad += why
            print("\n".join(lines + why) or "right", flush=True)
    print("\n".join([*table.lines(), *errors]))
    share = tally["right"] / max(1, sum(tally.values()))
    print("%d ended, %d whole: %d did not rest in their room; %d right (%.1f %%), %d not settled, %d wrong" % (
        kills, dialects, len(bad), tally["right"], 100.0 * share, tally["open"], tally["wrong"]))
    return 1 if bad or tally["wrong"] or (dialects and share < LEAST) else 0


if __name__ == "__main__":
    sys.exit(main())
