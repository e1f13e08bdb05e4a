"""The identity of a simulated controller: it differs from a real one, and from another, for clients that ask for it."""
import json
import subprocess

import pytest
from command_places import command_of
from raw_client import RawClient

from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.simulation.__main__ import main
from jaka_ros_driver.simulation.controller.executor import Controller
from jaka_ros_driver.simulation.controller.firmware import FIRMWARES
from jaka_ros_driver.simulation.controller.state import Options
from jaka_ros_driver.simulation.simulated_controller import SimulatedController

QUESTION = "get_simulator_identity"
FREE = ["--command-port", "0", "--status-port", "0", "--poll-port", "0"]


def identity_of(port):
    with RawClient(port) as client:
        return client.ask(QUESTION)["identity"]


@pytest.mark.parametrize("firmware", FIRMWARES)
def test_each_has_its_own_unless_told(make_arm, firmware):
    one, other = (identity_of(make_arm(firmware=firmware).command_port) for _ in range(2))
    assert one and other and one != other


def test_restart_keeps_it(make_arm):
    arm = make_arm()
    before = identity_of(arm.command_port)
    arm.operate("reboot", down=60)
    arm.operate("boot")
    assert identity_of(arm.command_port) == before


def test_core_makes_none_up():
    controller = Controller(load_model("zu7"), FIRMWARES["1.5.14"], Options())
    assert json.loads(controller.execute({"cmdName": QUESTION}).reply)["identity"] == ""


@pytest.mark.parametrize("identity", ["", "two words", "ümlaut", "line\n", "x" * 257])
def test_identity_that_cannot_be_one(identity, capsys):
    with pytest.raises(InvalidCommand, match="identity"):
        SimulatedController(identity=identity)
    assert main([*FREE, "--identity", identity]) == 1
    assert "identity" in capsys.readouterr().err


def test_option_of_the_program_and_its_first_line_stays_what_it_was():
    program = subprocess.Popen([*command_of("jaka_sim"), *FREE, "--identity", "here.I-am:1"],
                               stdout=subprocess.PIPE, text=True)
    try:
        line = program.stdout.readline()
        ports = json.loads(line)
        assert list(ports) == ["command_port", "status_port", "poll_port", "panel_port"]
        assert identity_of(ports["command_port"]) == "here.I-am:1"
    finally:
        program.terminate()
        program.communicate(timeout=20)
