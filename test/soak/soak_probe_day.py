"""The driver with the report of jaka_probe on the arm that was probed: does it live the whole day of an arm?

In the devel space:

    build/venv/bin/python3 test/soak/soak_probe_day.py [DIALECTS [FIRST]]        30, from 0

Each dialect is an unknown arm. The probe examines it with all stages, in virtual time; its report is the driver's
``controller_profile``; then the driver, with its guard, makes every call of the day (power, move, jog, servo, stop,
outputs, recovery) on a simulated controller of the same dialect, in real processes. What no stage can see, the replies
to the drives' commands, comes when the drives are on. Takes a quarter of a minute a dialect, two where the arm begins
late. Prints each day that fails, with where. Exit code 1 where one does.
"""
import contextlib
import io
import json
import sys
import tempfile
import traceback
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / folder) for folder in (".", "tools", "test/support", "test/support/live", "test/probe")]

from arm_day import live_a_day, probed_arm  # noqa: E402
from probe_bench import drawn  # noqa: E402
from ros_graph import master  # noqa: E402
from virtual_probe import probed  # noqa: E402

from jaka_ros_driver.probe import report  # noqa: E402
from jaka_ros_driver.probe.facts import ProbeStage  # noqa: E402

NOT_SEEN = {"power_reply_delay": 0.0, "enable_reply_delay": 0.0}


def day_of(seed, folder):
    """Probe a dialect, and live the day on it with what was found."""
    firmware, dialect = drawn(seed)
    dialect = dialect.replaced(NOT_SEEN)
    with contextlib.redirect_stdout(io.StringIO()):
        bench, facts = probed(dialect, firmware, ProbeStage.MOVE, 3, fits=True)
    found, as_dialect = folder / "probe.json", folder / "dialect.json"
    found.write_text(json.dumps(report.as_json(facts, list(bench.stages), True)), encoding="utf-8")
    as_dialect.write_text(json.dumps(dialect.as_dict()), encoding="utf-8")
    with probed_arm(str(found), "--firmware", firmware, "--dialect", str(as_dialect)) as arm:
        live_a_day(arm)


def main():
    words = [int(word) for word in sys.argv[1:]]
    count, first = [*words, *(30, 0)[len(words):]]
    failed = 0
    with master():
        for seed in range(first, first + count):
            with tempfile.TemporaryDirectory() as name:
                try:
                    day_of(seed, Path(name))
                except Exception:  # whatever it is, this day failed, and the next dialect has its own
                    failed += 1
                    print("dialect %d of %s:\n%s" % (seed, drawn(seed)[0], traceback.format_exc()), flush=True)
    print("%d dialects: %d days failed" % (count, failed))
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
