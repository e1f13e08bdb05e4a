"""The reserve of streams, ``~stream_ahead`` 0 to 4 cycles: what it saves a late driver, and what it costs at a stop.

Exact and the same on every computer: the driver's core and the simulated controller run in virtual time. The driver is
held up at drawn moments, by drawn times; the arm is looked at in each cycle of its controller.

    build/venv/bin/python3 test/benchmark/bench_stream_ahead.py
"""
import math
import random
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "test" / "support")]

from streamed_arm import REST, StreamedArm  # noqa: E402

from jaka_ros_driver.client.core.velocity_jog.dead_man import JogMessage  # noqa: E402
from jaka_ros_driver.client.core.velocity_jog.ramp import Wish  # noqa: E402
from jaka_ros_driver.commands import JogFrame  # noqa: E402
from jaka_ros_driver.kinematics.arm_models import load_model  # noqa: E402
from jaka_ros_driver.simulation.arm.plant import HOME  # noqa: E402
from jaka_ros_driver.trajectory.points import TrajectoryPoint  # noqa: E402

MODEL = load_model("zu7")
AHEAD = range(5)
QUEUES = (49, 4, 1, 0)
WAY, TAKES_S, TIMES = 1.2, 2.0, 10
HELD_UP_EVERY_S, SHORTEST_S, LONGEST_S = 0.1, 0.004, 0.048
JOLT = 20.0
"""Acceleration, rad/s2, above which a cycle is a jolt; trajectories need at most 12.5."""
STOPS = 12
JOG = Wish(JogFrame.JOINT, (0.5,) + REST[1:])


def late_driver(ahead, queue):
    """Print what a driver that is held up ten times a second does with trajectories."""
    arm, chance = StreamedArm(MODEL, HOME, stream_ahead=ahead, dialect={"servo_queue": queue}), random.Random(7)
    late, ended, held_up = 0, 0, 0
    for turn in range(TIMES):
        call = arm.begin_trajectory(TrajectoryPoint(TAKES_S, (WAY * (turn % 2 == 0), *HOME[1:]), REST))
        seen = 0
        while not call.is_over:
            arm.run(chance.expovariate(1.0 / HELD_UP_EVERY_S))
            arm.held_until = arm.now + SHORTEST_S * (LONGEST_S / SHORTEST_S) ** chance.random()
            held_up += 1
            seen = max(seen, arm.core.late_servo_cycles)
        late += seen
        ended += call.error is None
        arm.until(lambda: arm.core.is_free)
        arm.run(0.3)
        if call.error is not None:
            break
    accelerations = arm.accelerations()
    print("ahead %d  the controller keeps %2d  held up %3d times  cycles left out %3d  cycles without a frame %3d  "
          "jolts %3d  hardest %5.0f rad/s2  trajectories %d of %d" % (
              ahead, queue, held_up, late, arm.halts() - standing(arm), (accelerations > JOLT).sum(),
              accelerations.max(), ended, turn + 1))


def standing(arm):
    """Return the cycles in which the arm stood because a trajectory was over: those of pauses above 0.2 s."""
    run = total = 0
    for before, after in zip(arm.places, arm.places[1:]):
        run = run + 1 if before == after else 0
        if run == 25:
            total += 24
        total += run >= 25
    leading = next(i for i, place in enumerate(arm.places) if place != arm.places[0]) - 1
    trailing = next(i for i, place in enumerate(reversed(arm.places)) if place != arm.places[-1]) - 1
    return total - sum(length for length in (leading, trailing) if length >= 25)


def stop_after(ahead, drops, moment):
    """Return the time from a stop in a trajectory to rest, s."""
    arm = StreamedArm(MODEL, HOME, stream_ahead=ahead, dialect={"stop_drops_frames": drops})
    arm.begin_trajectory(TrajectoryPoint(TAKES_S, (WAY, *HOME[1:]), REST))
    arm.run(moment)
    called_at = arm.now
    arm.ended(arm.begin("stop"))
    arm.until(lambda: arm.core.is_free)
    arm.run(0.5)
    return arm.rest_after(called_at) - called_at


def released_after(ahead, moment, says_rest):
    """Return the time from the last message of a velocity jog to rest, s; ``says_rest``: it is one of rest."""
    arm = StreamedArm(MODEL, HOME, stream_ahead=ahead)
    arm.run(moment)
    arm.jog(JOG, 0.6)
    last = arm.now - 0.02
    if says_rest:
        last = arm.now
        message = JogMessage("pad", int(1e9 * last), 0.0, last, JOG._replace(velocity=REST))
        arm.act(lambda now: arm.core.jog_velocity(message, now))
    arm.until(lambda: arm.core.is_free)
    return arm.rest_after(last) - last


def moments(count, low, high):
    return [low + (high - low) * math.modf(number * 0.618)[0] for number in range(count)]


def main():
    for queue in QUEUES:
        for ahead in AHEAD:
            late_driver(ahead, queue)
    for ahead in AHEAD:
        drops, runs_out = ([stop_after(ahead, drops, moment) for moment in moments(STOPS, 0.9, 1.3)]
                           for drops in (True, False))
        silent, rested = ([released_after(ahead, moment, says_rest) for moment in moments(STOPS, 0.0, 0.05)]
                          for says_rest in (False, True))
        print("ahead %d  to rest, from a stop: frames dropped %3.0f ms, run out %3.0f ms; from a jog's last message: "
              "silence %3.0f ms, a message of rest %3.0f ms" % (
                  ahead, 1e3 * max(drops), 1e3 * max(runs_out), 1e3 * max(silent), 1e3 * max(rested)))


if __name__ == "__main__":
    main()
