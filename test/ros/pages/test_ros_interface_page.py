"""The page docs/ros-interface.md: its commands as they stand there, against a driver on a simulated controller."""
import contextlib
import math
import re

import import_graph
import pytest
from driver_bench import HOME, SimulatorProcess
from page_commands import blocks, until
from waiting import eventually

from jaka_ros_driver.client.core.procedures.recovery import RecoveryStep

SEEN_DEG = 0.5
PAGE = import_graph.ROOT / "docs" / "ros-interface.md"
ANSWERS = {
    "rostopic echo -n 1 /jaka_driver/io_states/cabinet": "digital_inputs: [False, False",
    "rostopic echo -n 1 /jaka_driver/joint_temperatures": "data: [31.0, 31.0",
    "rostopic echo -n 1 /jaka_driver/joint_currents": "data: [0.4, 0.4",
    "rostopic echo -n 1 /jaka_driver/wrench": "frame_id: \"tool0\"",
    "rosservice call /jaka_driver/zero_ftsensor": 'message: "the force sensor reads zero"',
    "rosservice call /jaka_driver/recover": 'message: "the arm is ready: ',
    "rosservice call /jaka_driver/pause": 'message: "a trajectory is paused;',
    "rosservice call /jaka_driver/resume": 'message: "a trajectory goes on"',
    'rosservice call /jaka_driver/set_speed_slider "speed_slider_fraction: 0.5"': 'message: "speed 50 %"',
    "rostopic echo -n 1 /jaka_driver/speed_scaling_factor": "data: 0.5",
    'rosservice call /jaka_driver/set_speed_slider "speed_slider_fraction: 1.0"': 'message: "speed 100 %"',
    'rosservice call /jaka_driver/program/load "name: weld.jks"': 'message: "program weld.jks loaded"',
    "rosservice call /jaka_driver/program/play": 'message: "the program runs;',
    "rosservice call /jaka_driver/program/pause": 'message: "the program is paused;',
    "rosservice call /jaka_driver/program/resume": 'message: "the program goes on"',
    "rosservice call /jaka_driver/program/stop": 'message: "no program runs,',
    "rostopic echo -n 1 /jaka_driver/program/state": 'program: "weld.jks"',
    "rostopic type /jaka_driver/robot_status": "industrial_msgs/RobotStatus",
    "rosrun jaka_ros_driver jaka_bag info --freq status.bag": "/jaka_driver/robot_status",
}


@pytest.fixture(scope="module")
def simulator():
    """Start a simulated controller with a force sensor, which a section of the page is about."""
    with contextlib.closing(SimulatorProcess("--start", "enabled", "--force-sensor")) as process:
        yield process


def has_moved(arm):
    """Return whether the arm is away from home."""
    away = [abs(a - math.degrees(b)) for a, b in zip(arm.simulator.state()["joint_position"], HOME)]
    return max(away) > SEEN_DEG


@pytest.mark.timeout(600)
def test_each_command_of_the_page(shell, arm):
    ran = []
    assert arm.call("enable", data=False).success
    for block in blocks(PAGE):
        assert block.language == "sh"
        if block.note == "with blocking:=false":
            continue  # test_queue.py runs it
        if block.note:
            shell.start("feedback", block.text.strip())
            until(lambda: "recover/feedback" in shell.run("rostopic list -s")[1], lambda: shell.said_by("feedback"))
            assert arm.call("enable", data=False).success
            continue
        for line in block.text.strip().splitlines():
            if "move_path/goal" in line:
                arm.wait_until_ready()
                assert eventually(lambda: arm.call("recover").success)
            if ("_controller/command" in line and "points" in line) or "/jog_" in line:
                arm.wait_until_ready()
                arm.go_home()
            code, said = shell.run(line)
            assert code == 0, "%s\n%s" % (line, said)
            assert ANSWERS.get(line, "") in said, "%s\n%s" % (line, said)
            if "recover/goal" in line:
                until(lambda: "step: \"enable\"" in shell.said_by("feedback"), lambda: shell.said_by("feedback"))
            if "_controller/command" in line:
                is_sent = "points" in line
                until(lambda is_sent=is_sent: arm.simulator.is_moving() is is_sent, lambda: "the arm moves, or rests")
            if "/jog_" in line:  # a busy host may end the jog
                assert any(has_moved(arm) or shell.run(line)[0] for _ in range(5)), "%s\n%s" % (line, said)
            if "move_path/" in line:
                until(lambda line=line: arm.simulator.is_moving() is ("goal" in line), lambda: "it moves, or rests")
            ran.append(line)
    assert set(ANSWERS) <= set(ran) and len(ran) == 34


def test_the_tables_of_recovery_name_the_steps_of_the_code():
    section = PAGE.read_text(encoding="utf-8").partition("## Recovery")[2]
    rows = re.findall(r"^\| `([a-z ]+)` \| ", section, re.MULTILINE)
    assert rows[:4] == [step.value for step in RecoveryStep]
