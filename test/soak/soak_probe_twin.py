"""A driver and a twin from one probe: do arm and twin make the same logs, by jaka_bag compare?

In the devel space:

    build/venv/bin/python3 test/soak/soak_probe_twin.py [DIALECTS [FIRST]]        10, from 0

Each dialect is an unknown arm: jaka_probe examines it with all stages, and its report makes both the driver's
``controller_profile`` and a simulated controller, by ``--like``. Then the driver makes the calls of two golden logs on
the arm and on the twin, each is recorded, and ``jaka_bag compare`` judges the two logs of each by ``TOLERANCES``. An
arm that begins seconds after the acceptance does not fit into the times of these logs, so here it begins within half a
second; and they have the pose of the tool, so its feed has it. Takes about three minutes a dialect, most of it waiting.
Prints the tolerances and, of each log, the verdict, and how many motions both have. Exit code 1 where two logs are not
the same, or nothing moved.
"""
import dataclasses
import json
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / folder) for folder in (".", "tools", "test/support", "test/support/live")]

from command_places import command_of  # noqa: E402
from probe_bench import Controller, ProbeOnTerminal, command, drawn, facts_in  # noqa: E402

from jaka_bag.compare.runs.loading import load_run  # noqa: E402
from jaka_bag.errors import BagError  # noqa: E402
from jaka_regression.replay import record_script  # noqa: E402
from jaka_regression.scenario import scenario_of  # noqa: E402
from jaka_regression.stage import script_of  # noqa: E402
from jaka_ros_driver.probe.facts import Fact  # noqa: E402

GOLDEN = ROOT / "test" / "data" / "golden"
LOGS = ("joint_moves", "stop_in_mid_move")
LONGEST_DELAY_S = 0.5
NEEDED = "actual_position"
TOLERANCES = """\
joints: {position_rad: 0.02}
tcp: {position_mm: 15.0, orientation_rad: 0.03}
timing: {event_s: 0.3, wait_s: 0.3, cut_ms: 250, pace_percent: 3.0, pace_floor_ms: 100}
"""
"""The tolerances of an arm and its twin that differ from the usual ones."""


def arm_of(folder, seed):
    """Return the options of the simulated controller that is an unknown arm, and its firmware."""
    firmware, dialect = drawn(seed)
    dialect = dialect.replaced({"start_delay": min(dialect.start_delay, LONGEST_DELAY_S), "missing_frame_fields": [
        name for name in dialect.missing_frame_fields if name != NEEDED]})
    path = folder / "dialect.json"
    path.write_text(json.dumps(dialect.as_dict()), encoding="utf-8")
    return ("--firmware", firmware, "--dialect", str(path)), firmware


def probed(folder, options):
    """Probe such an arm with all stages; return the path of the report, and the program's exit code."""
    arm = Controller(folder, *options)
    terminal = ProbeOnTerminal(command(folder / "probe", arm.ports, "--stage", "move", "--output", "3"))
    code = terminal.end()
    arm.close()
    return folder / "probe" / "probe.json", code


def recorded(golden, folder, options, report):
    """Make the calls of a golden log on a simulated controller; return the path of the new log."""
    known, run = scenario_of(golden), load_run(golden)
    arm = dataclasses.replace(known.arms[0], simulation=("--start", "enabled", *options),
                              parameters=(*known.arms[0].parameters, ("controller_profile", str(report))))
    folder.mkdir()
    return record_script(script_of(run), folder, dataclasses.replace(known, arms=(arm,)))


def compared(one, other, limits):
    """Return whether ``jaka_bag compare`` calls two logs the same, what it says, and the motions of the first."""
    done = subprocess.run([*command_of("jaka_bag"), "compare", "--tolerances", str(limits), str(one), str(other)],
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=120)
    motions = max((len(track.facts.motions) for track in load_run(one).joints.values()), default=0)
    return done.returncode == 0, done.stdout, motions


def main():
    words = [int(word) for word in sys.argv[1:]]
    count, first = [*words, *(10, 0)[len(words):]]
    print("tolerances beside the usual ones:\n" + TOLERANCES, flush=True)
    bad = 0
    for seed in range(first, first + count):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            limits = folder / "tolerances.yaml"
            limits.write_text(TOLERANCES, encoding="utf-8")
            options, firmware = arm_of(folder, seed)
            report, code = probed(folder, options)
            found = facts_in(report.parent)
            print("dialect %d of %s: probe ended with %d, twin within %s deg and %s s" % (
                seed, firmware, code, *(found.get(one, Fact(None, "")).value for one in ("twin_angle", "twin_time"))),
                flush=True)
            for log in LOGS:
                golden = GOLDEN / (log + ".mcap")
                try:
                    pair = [recorded(golden, folder / ("%s-%s" % (log, who)), words, report) for who, words in (
                        ("arm", options), ("twin", ("--like", str(report))))]
                except BagError as error:
                    bad += 1
                    print("  %s: not recorded, %s" % (log, error), flush=True)
                    continue
                is_same, told, motions = compared(*pair, limits)
                bad += not is_same or not motions
                print("  %s: %s, %d motions%s" % (log, "the same" if is_same else "DIFFERENT", motions,
                                                  "" if is_same else "\n" + told), flush=True)
    print("%d dialects, %d logs each: %d not the same" % (count, len(LOGS), bad))
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
