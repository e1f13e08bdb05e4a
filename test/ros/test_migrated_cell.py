"""A cell for the maker's driver, migrated: its node makes the arm do what the maker's driver would have made it do.

Before: the requests of test/data/migration/wire.yaml, sent to a simulated controller. After: migrate_cell, the cell's
launch file, the cell's node, a simulated controller of the same kind.
"""
import contextlib
import json
import math
import os
import shutil
import subprocess
import sys
import time

import pytest
import rospy
import yaml
from command_places import command_of
from driver_bench import Arm, DriverProcess, SimulatorProcess, on
from import_graph import ROOT
from raw_client import RawClient
from ros_graph import launched_parent
from waiting import WAIT, eventually
from wire_verdict import WireVerdict

from jaka_ros_driver.kinematics.rotations import matrix_from_rpy, rotation_angle_between

DATA = ROOT / "test" / "data" / "migration"
WIRE = yaml.safe_load((DATA / "wire.yaml").read_text())


@contextlib.contextmanager
def controller(folder, name):
    """Run a simulated controller; yield it and the path of its log."""
    log = folder / (name + ".mcap")
    with contextlib.closing(SimulatorProcess("--start", "enabled", "--log", str(log))) as simulator:
        yield simulator, log


def makers_requests(interface):
    """Return what the maker's driver sends."""
    requests = [dict(request) for request in WIRE["requests"]]
    requests[-1]["index"] = WIRE["output_index"][interface]
    return requests


def ended(simulator):
    """Return the pose at which the arm rests, mm and deg, and the cabinet's outputs that are on, counted from 0."""
    assert eventually(lambda: not simulator.is_moving())
    state = simulator.state()
    return state["tcp_pose"], [place for place, value in enumerate(state["digital_outputs"]) if value]


def before(interface, folder):
    """Send the maker's requests, one after the other, as its SDK does; return how it ended."""
    with controller(folder, "before") as (simulator, _):
        link = RawClient(simulator.command_port)
        for request in makers_requests(interface):
            link.send(json.dumps(request).encode())
            assert link.reply()["errorCode"] == "0", request
            if request["cmdName"].startswith("servo_"):
                time.sleep(0.05)  # servo targets are taken once a cycle of 8 ms
            for name, held in (("jointPosition", "joint_position"), ("cartPosition", "tcp_pose")):
                if name in request and not request["relFlag"]:
                    assert eventually(lambda held=held, target=request[name]: simulator.state()[held][:3] == (
                        pytest.approx(target[:3], abs=1e-3))), request
            ended(simulator)
        link.socket.close()
        return ended(simulator)


def migrated(cell, launch_file, interface, simulator):
    """Change the cell by migrate_cell; return its launch file, to which the ports that a test can have are added."""
    done = subprocess.run([*command_of("migrate_cell"), str(cell), "--write", "--yes", "--interface", interface,
                           "--model", "zu7"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert done.returncode == 0 and "written: launch/" + launch_file in done.stdout, done.stdout
    path = cell / "launch" / launch_file
    line, = [line for line in path.read_text().splitlines(True) if 'name="interface"' in line]
    values = {"command_port": simulator.command_port, "status_port": simulator.status_port, "guard": "false"}
    if "<arg" in line:
        values["sim"] = "false"
    more = [line.replace('"interface"', '"%s"' % name).replace('"%s"' % interface, '"%s"' % value).replace(
        ' type="str"', "") for name, value in values.items()]
    path.write_text(path.read_text().replace(line, line + "".join(more)))
    return path


@pytest.mark.parametrize("interface, launch_file, words", [
    ("vendor", "cell.launch", ["ip:=127.0.0.1"]), ("vendor_2025", "own_node.launch", [])])
def test_a_migrated_cells_program_moves_the_arm_as_the_makers_driver_did(
        ros_node, tmp_path, interface, launch_file, words):
    pose, outputs = before(interface, tmp_path)
    cell = tmp_path / "makers_cell"
    shutil.copytree(str(DATA), str(cell))
    with controller(tmp_path, "after") as (simulator, log):
        path = migrated(cell, launch_file, interface, simulator)
        with launched_parent([(str(path), words)], is_core=False):
            assert eventually(lambda: rospy.get_param("/jaka_driver/interface", "") == interface)
            rospy.wait_for_service("/jaka_driver/get_fk", WAIT)
            assert eventually(lambda: simulator.state()["is_enabled"])
            done = subprocess.run(
                [sys.executable, str(cell / "move_part.py"), *map(str, WIRE["orientation"][interface])],
                stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=4 * WAIT, env=dict(os.environ))
            assert done.returncode == 0 and "output 3 reads 1" in done.stdout, done.stdout
            end, is_on = ended(simulator)
    if launch_file == "own_node.launch":
        rospy.delete_param("/ip")
    assert end[:3] == pytest.approx(pose[:3], abs=0.05)
    turn, wanted = (matrix_from_rpy([math.radians(angle) for angle in one[3:]]) for one in (end, pose))
    assert rotation_angle_between(turn, wanted) < 1e-3
    assert is_on == outputs and len(outputs) == 1
    sent = [request for _, request in WireVerdict(log).received()]
    for request in makers_requests(interface):  # each once where its end counts; of servo targets the end alone does
        if not request["cmdName"].startswith("servo_"):
            same = [one for one in sent if one["cmdName"] == request["cmdName"]]
            assert any(is_alike(one, request) for one in same), "%s\n%s" % (request, same)


def is_alike(one, other):
    """Return whether both requests ask for the same, whatever speed of turning they name."""
    names = {"jointPosition", "cartPosition", "speed", "accel", "relFlag", "index", "type", "value"} & set(other)
    return all(one.get(name) == pytest.approx(other[name], abs=1e-3) for name in names)


@pytest.fixture
def common_ip(ros_node):
    """Return a function that sets the global parameter ip, for this test."""
    yield lambda value: rospy.set_param("/ip", value)
    rospy.delete_param("/ip")


def test_a_node_without_an_address_of_its_own_takes_the_global_one_and_says_so(common_ip, tmp_path):
    common_ip("localhost")
    with controller(tmp_path, "common") as (simulator, _):
        values = on(simulator, guard=False)
        del values["ip"]
        with DriverProcess("common", **values) as driver:
            Arm(simulator, "/common").wait_until_seen()
            code, said = driver.end()
    assert code == 0 and "~ip is not set: the controller is the one that /ip names, localhost" in said, said
    assert "at localhost:%d" % simulator.command_port in said


def test_a_global_ip_of_something_else_keeps_the_driver_from_its_start(common_ip):
    common_ip({"of": "a camera"})
    with DriverProcess("refused") as driver:
        code, said = driver.wait()
    assert code == 2 and "cannot start: ~ip is not set, and /ip is {'of': 'a camera'}" in said, said
