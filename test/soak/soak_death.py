"""The time to rest when the driver's process ends, dies or freezes: every way x every motion, many times.

Moments on the wire and of the arm are those of the simulated controller's log. In the devel space; it takes a quarter
of an hour:

    build/venv/bin/python3 test/soak/soak_death.py [REPEATS [DIALECTS]]        20, none

With DIALECTS, on each of so many controllers whose dialects are drawn.
"""
import signal
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / folder) for folder in (".", "test/support", "test/support/live")]

from drawn_dialects import dialect_options  # noqa: E402
from driver_bench import LiveDriver, begin  # noqa: E402
from figures import summary  # noqa: E402
from ros_graph import master  # noqa: E402
from waiting import eventually  # noqa: E402

MOTIONS = ("move", "jog", "servo")
ENDS = {"SIGINT": signal.SIGINT, "SIGTERM": signal.SIGTERM}
DEATHS = {"SIGKILL": signal.SIGKILL, "SIGSEGV": signal.SIGSEGV, "SIGSTOP": signal.SIGSTOP}


def deaths_of(live, number, motion, repeats):
    """Return (moment of the signal, moment at which the arm was seen at rest) of each repeat."""
    moments = []
    for _ in range(repeats):
        if live.process.poll() is not None:
            live.start()
        live.arm.wait_until_seen()
        live.arm.listen("robot_states", 1)
        pending = begin(live, motion)
        time.sleep(0.2)
        since = live.send(number)
        assert eventually(lambda: not live.simulator.is_moving() and not live.simulator.state()["is_servo_active"]), (
            "the arm was not stopped")
        moments.append((since, time.monotonic()))
        if number == signal.SIGSTOP and live.process.poll() is None:  # else its guard has killed it, to reach the arm
            live.send(signal.SIGCONT)
        else:
            live.process.communicate(timeout=20.0)
            assert eventually(lambda: not live.guards()), "a guard is left"
        if pending is not None:
            pending.wait()
    return moments


def measure(how, number, motion, repeats, folder, options=()):
    with LiveDriver(folder, simulator=options) as live:
        live.arm.wait_until_ready()
        moments = deaths_of(live, number, motion, repeats)
        verdict = live.verdict()
    opened = [event.time_ns * 1e-9 for event in verdict.wire("command", "open")]
    stops = [min(verdict.times_of("stop_program", after=since)) for since, _ in moments]
    figures = [("stop on the wire", [stop - since for stop, (since, _) in zip(stops, moments)]),
               ("arm at rest", [verdict.rest_after(since, until) - since for since, until in moments])]
    if number in DEATHS.values():
        figures.insert(0, ("guard on the port", [min(at for at in opened if at > since) - since
                                                 for since, _ in moments]))
    for what, values in figures:
        print("%-8s %-6s %-18s %s" % (how, motion, what, summary(values)), flush=True)


def main(repeats, dialects):
    with master(), tempfile.TemporaryDirectory() as folder:
        for options, text in [dialect_options(1 + number, folder) for number in range(dialects)] or [((), "usual")]:
            print(text, flush=True)
            for how, number in {**ENDS, **DEATHS}.items():
                for motion in MOTIONS:
                    measure(how, number, motion, repeats, folder, options)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:] + ["20", "0"][len(sys.argv) - 1:]))
