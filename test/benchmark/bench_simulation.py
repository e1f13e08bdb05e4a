"""The cost of the simulated controller: cycle lateness, CPU, status frames, requests, inverse kinematics.

    build/venv/bin/python3 test/benchmark/bench_simulation.py [--seconds 10] [--instances 4] [--realtime]

Each instance is a process of its own.
"""
import argparse
import json
import os
import random
import subprocess
import sys
import threading
import time
import timeit
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "test" / "support")]

from program_places import command_of  # noqa: E402
from raw_client import RawClient, RawFeed  # noqa: E402

from jaka_ros_driver.kinematics import closed_forms  # noqa: E402
from jaka_ros_driver.kinematics.arm_models import load_model  # noqa: E402
from jaka_ros_driver.kinematics.forward import forward  # noqa: E402
from jaka_ros_driver.simulation.controller.executor import Controller  # noqa: E402
from jaka_ros_driver.simulation.controller.firmware import FIRMWARES  # noqa: E402
from jaka_ros_driver.simulation.controller.state import Options, Start  # noqa: E402
from jaka_ros_driver.simulation.server.event_loop import ask_operator_port  # noqa: E402
from jaka_ros_driver.simulation.server.request_parser import RequestParser  # noqa: E402
from jaka_ros_driver.units import deg_to_rad  # noqa: E402

MOVE = {"cmdName": "moveL", "cartPosition": [460.0, 60.0, 320.0, 180.0, 0.0, -90.0], "speed": 50.0, "accel": 200.0}


def microseconds(action, number=2000):
    return min(timeit.repeat(action, number=number, repeat=3)) / number * 1e6


def costs():
    """Return the costs of single steps, us: the best of three rounds."""
    for name in FIRMWARES:
        controller = Controller(load_model("zu7"), FIRMWARES[name], Options(start=Start.ENABLED))
        controller.execute({"cmdName": "joint_move", "jointPosition": [170.0, 90, -90, 90, 90, 0], "speed": 1.0})

        def moving_frame(frame, controller=controller):
            controller.step(0.008)
            return frame.text()
        step = microseconds(lambda c=controller: c.step(0.008))
        for kind in ("feed_frame", "polled_frame"):
            frame = getattr(controller, kind)
            cost = microseconds(lambda f=frame: moving_frame(f)) - step
            print("frame %-6s %-12s in motion, %5d bytes  %8.1f us" % (name, kind, len(frame.text()), cost))
    print("cycle, joint move                             %8.1f us" % step)
    controller = Controller(load_model("zu7"), FIRMWARES["1.5.14"], Options(start=Start.ENABLED))
    controller.execute(dict(MOVE, speed=1.0))
    print("cycle, linear move                            %8.1f us" % microseconds(lambda: controller.step(0.008)))
    request = json.dumps(dict(MOVE, cmdName="kine_forward", jointPosition=[0.0, 90, -90, 90, 90, 0])).encode()
    parser = RequestParser()
    print("parse a request of %3d bytes                  %8.1f us" % (
        len(request), microseconds(lambda: parser.feed(request, 0.0))))
    chance = random.Random(1)
    plant, poses = controller.state.plant, []
    while len(poses) < 200:
        joints = [deg_to_rad(chance.uniform(low, high)) for low, high in (
            (-180, 180), (30, 150), (-130, -30), (30, 150), (30, 150), (-180, 180))]
        poses.append((plant.forward(joints), joints))
    turn = iter(range(10 ** 9))

    def inverse():
        pose, reference = poses[next(turn) % len(poses)]
        plant.inverse_nearest(pose, reference)
    print("inverse kinematics, nearest of all branches   %8.1f us" % microseconds(inverse))
    model = load_model("zu7")
    flange = forward(model, poses[0][1])
    print("inverse kinematics, closed form alone         %8.1f us" % microseconds(
        lambda: closed_forms.three_parallel(model.dh, flange, 0.0)))


def cpu_seconds(pid):
    fields = Path("/proc/%d/stat" % pid).read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


class Instance:
    """A simulated controller in a process of its own, one client at 125 Hz that keeps the arm moving."""

    def __init__(self, *more):
        self.program = subprocess.Popen(
            [*command_of("jaka_sim"), "--command-port", "0", "--status-port", "0",
             "--poll-port", "0", "--start", "enabled", *more], stdout=subprocess.PIPE, text=True, cwd=str(ROOT))
        self.ports = json.loads(self.program.stdout.readline())
        self.times = []
        self._ends = False
        self._thread = threading.Thread(target=self._client)
        self._thread.start()

    def _client(self):
        with RawClient(self.ports["command_port"]) as client, RawFeed(self.ports["status_port"]) as feed:
            assert client.code("set_port10000_delay_ms", port10000_delay_ms=8) == "0"
            there = False
            while not self._ends:
                frame = feed.raw_frame()
                self.times.append(time.monotonic())
                if b'"inpos": true' in frame:
                    there = not there
                    y = 60.0 if there else 160.0
                    client.ask(**dict(MOVE, command="moveL", cartPosition=[440.0, y, 330.0, 180.0, 0.0, -90.0]))

    def lateness(self):
        return ask_operator_port(self.ports["panel_port"], {"action": "wire"})["wire"]["cycle_lateness"]

    def end(self):
        self._ends = True
        self._thread.join()
        self.program.terminate()
        self.program.wait()
        self.program.stdout.close()


def run(count, seconds, *more):
    instances = [Instance(*more) for _ in range(count)]
    time.sleep(2.0)
    before = [(cpu_seconds(i.program.pid), len(i.times), time.monotonic()) for i in instances]
    time.sleep(seconds)
    for number, (instance, (cpu, frames, began)) in enumerate(zip(instances, before), 1):
        span = time.monotonic() - began
        gaps = sorted(b - a for a, b in zip(instance.times[frames:], instance.times[frames + 1:]))
        late = instance.lateness()
        print("%d of %d: cycle late p50 %.3f p99 %.3f max %.3f ms, %d lags; CPU %.1f %%; %.1f frames/s, "
              "gap p99 %.2f ms" % (number, count, late["median_s"] * 1e3, late["p99_s"] * 1e3, late["max_s"] * 1e3,
                                   late["lags"], (cpu_seconds(instance.program.pid) - cpu) / span * 100.0,
                                   (len(instance.times) - frames) / span, gaps[int(0.99 * len(gaps))] * 1e3))
    for instance in instances:
        instance.end()


def main():
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seconds", type=float, default=10.0, help="of each measurement, default 10")
    parser.add_argument("--instances", type=int, default=4, help="side by side, default 4")
    parser.add_argument("--realtime", action="store_true", help="start them with --realtime")
    options = parser.parse_args()
    more = ["--realtime"] if options.realtime else []
    print("host: %d cores, load %.2f" % (os.cpu_count(), os.getloadavg()[0]))
    costs()
    run(1, options.seconds, *more)
    run(options.instances, options.seconds, *more)


if __name__ == "__main__":
    main()
