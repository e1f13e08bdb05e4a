"""A gripper with a width on a running driver: goals, analog outputs, readings, its joint.

Once as docs/examples/gripper_width.yaml describes it, on registers, and once on 0 to 10 V of the cabinet.
"""
import contextlib
import math
import subprocess

import pytest
import rospy
import yaml
from action_bench import Client
from driver_bench import Arm, DriverProcess, SimulatorProcess, collecting, on
from import_graph import ROOT
from page_commands import blocks
from sensor_msgs.msg import JointState
from waiting import WAIT, eventually

from jaka_ros_driver.ros.other_messages import message_type

NAME = "spreading"
KIND = message_type("control_msgs/GripperCommandAction")
REGISTERS = yaml.safe_load((ROOT / "docs" / "examples" / "gripper_width.yaml").read_text(encoding="utf-8"))["gripper"]
VOLTS = {**REGISTERS, "output_bank": "cabinet", "input_bank": "cabinet", "analog_output": 2, "open_value": 10.0,
         "closed_value": 0.0}
AT_OPEN, AT_HALF, AT_CLOSED = 1.0, 0.5, 0.0
"""Shares of the largest value."""


class Gripper:
    """A gripper as the operator port of the simulated controller plays it, and a client of its goals."""

    def __init__(self, arm, keys, client):
        self._arm, self._keys, self._client = arm, keys, client

    def show(self, share):
        self._arm.simulator.operate("set_input", bank=self._keys["input_bank"].replace("_slave", ""), signal="analog",
                                  index=self._keys["analog_input"], value=share * self._keys["open_value"])

    def output(self):
        """Return the output as the controller has it, as a share of the largest value."""
        bank = getattr(self._arm.listen("io_states", 1)[0], self._keys["output_bank"])
        return bank.analog_outputs[self._keys["analog_output"]] / self._keys["open_value"]

    def begin(self, position):
        goal = type(KIND().action_goal.goal)()
        goal.command.position = position
        return self._client.send(goal)

    def end(self, handle):
        state, result = self._client.end(handle)
        return state, result.position, result.stalled, result.reached_goal, handle.get_goal_status_text()


@pytest.fixture(scope="module", params=[REGISTERS, VOLTS], ids=["registers", "volts"])
def gripper(ros_node, request):
    with contextlib.closing(SimulatorProcess("--start", "enabled", "--firmware", "1.7")) as simulator:
        rospy.set_param("/%s/gripper" % NAME, request.param)
        with DriverProcess(NAME, **on(simulator, guard=False)):
            arm = Arm(simulator, "/" + NAME)
            arm.wait_until_ready()
            with contextlib.closing(Client("/jaka_gripper_controller/gripper_cmd", KIND)) as client:
                yield Gripper(arm, request.param, client)
        rospy.delete_param("/%s/gripper" % NAME)


def test_it_goes_where_a_goal_asks_and_its_joint_is_where_the_input_shows_it(gripper):
    with collecting("/joint_states", JointState) as received:
        def is_told(position):
            told = [message.position[0] for _, message in list(received) if message.name == ["finger_joint"]]
            return bool(told) and told[-1] == pytest.approx(position, abs=1e-4)

        gripper.show(AT_OPEN)
        assert eventually(lambda: is_told(0.08)), "no goal is needed"
        handle = gripper.begin(0.04)
        assert eventually(lambda: gripper.output() == pytest.approx(AT_HALF))
        gripper.show(0.8)
        assert eventually(lambda: is_told(0.064)), "on its way"
        gripper.show(AT_HALF)
        assert gripper.end(handle)[:4] == ("SUCCEEDED", pytest.approx(0.04), False, True)
        assert is_told(0.04) or eventually(lambda: is_told(0.04))


def test_the_commands_of_the_page_set_it_up_and_move_it(gripper):
    page = blocks(ROOT / "docs" / "gripper.md")
    load, move = next(block.text for block in page if block.language == "sh").splitlines()
    subprocess.run(load, shell=True, check=True, cwd=str(ROOT), timeout=WAIT)
    assert rospy.get_param("/jaka_driver/gripper") == REGISTERS
    gripper.show(AT_OPEN)
    with subprocess.Popen(move, shell=True, cwd=str(ROOT), stdout=subprocess.PIPE, text=True) as program:
        assert eventually(lambda: gripper.output() == pytest.approx(AT_HALF))
        gripper.show(AT_HALF)
        said = program.communicate(timeout=WAIT)[0]
    assert program.returncode == 0 and said.startswith("SUCCEEDED at 0.040: the input shows 0.04"), said
    rospy.delete_param("/jaka_driver/gripper")


def test_one_that_stands_still_on_its_way_to_close_holds_a_work_piece(gripper):
    gripper.show(AT_OPEN)
    handle = gripper.begin(0.0)
    gripper.show(0.3)
    assert gripper.end(handle)[:4] == ("SUCCEEDED", pytest.approx(0.024), True, False)
    assert eventually(lambda: gripper.output() == pytest.approx(AT_CLOSED))


def test_one_that_does_not_move_aborts_the_goal_and_its_output_stays(gripper):
    gripper.show(AT_OPEN)
    state, position, is_stalled, reached, text = gripper.end(gripper.begin(0.0))
    assert (state, is_stalled, reached) == ("ABORTED", False, False) and position == pytest.approx(0.08)
    assert "not at 0 within 1.5 s: the input shows 0.08" in text
    assert eventually(lambda: gripper.output() == pytest.approx(AT_CLOSED))


def test_a_reading_of_no_gripper_is_no_position(gripper):
    gripper.show(1.5)
    state, position, _, _, text = gripper.end(gripper.begin(0.08))
    assert state == "ABORTED" and math.isnan(position) and "no input shows a position" in text
