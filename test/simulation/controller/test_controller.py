"""The controller without its sockets: it answers every request, and the arm stays within its limits."""
import hashlib
import json
import os
import random
import subprocess
import sys

import pytest
from good_requests import GOOD
from import_graph import ROOT, outside_imports

from jaka_ros_driver.errors import FramingError
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.simulation.controller.command_spec import Then
from jaka_ros_driver.simulation.controller.command_table import COMMANDS
from jaka_ros_driver.simulation.controller.executor import Controller
from jaka_ros_driver.simulation.controller.firmware import FIRMWARES
from jaka_ros_driver.simulation.controller.state import Options, Start
from jaka_ros_driver.simulation.dialect.table import Dialect

OFTEN = ("joint_move", "moveL", "movc", "end_move", "jog", "servo_move", "servo_j", "servo_p", "stop_program",
         "torque_control_enable", "pause_program", "resume_program", "rapid_rate", "clear_error", "enable_robot")


def make(model="zu7", firmware="1.5.14", start=Start.ENABLED):
    quick = Dialect.default(firmware).replaced({"power_delay": 0.1, "enable_delay": 0.1})
    return Controller(load_model(model), FIRMWARES[firmware], Options(quick, start))


def test_error_of_the_framing_is_answered_as_not_understood():
    outcome = make().execute(FramingError("bad bytes"))
    assert json.loads(outcome.reply) == {"errorCode": "1", "errorMsg": "Exception:function call failed"}
    assert outcome.command is None and outcome.then is Then.NOTHING


def test_quit_and_shutdown_say_what_follows():
    assert make().execute({"cmdName": "quit"}).then is Then.CLOSE
    assert make(start=Start.OFF).execute({"cmdName": "shutdown"}).then is Then.SHUT_DOWN
    assert make().execute({"cmdName": "shutdown"}).then is Then.NOTHING


def test_bug_in_a_handler_is_answered_and_told(monkeypatch, capsys):
    controller = make()
    monkeypatch.setattr(controller.state.plant, "forward", lambda joints: 1 / 0)
    outcome = controller.execute({"cmdName": "kine_forward", "jointPosition": [0.0] * 6})
    assert json.loads(outcome.reply)["errorCode"] == "1" and controller.failures == 1
    assert "ZeroDivisionError" in capsys.readouterr().err


def test_a_reply_that_cannot_be_written_is_a_failure_and_ends_nothing(monkeypatch, capsys):
    controller = make()
    spec = COMMANDS["get_version"]._replace(handler=lambda state, arguments: {"version": float("inf")})
    monkeypatch.setitem(COMMANDS, "get_version", spec)
    outcome = controller.execute({"cmdName": "get_version"})
    assert json.loads(outcome.reply)["errorCode"] == "1" and controller.failures == 1
    assert "FramingError" in capsys.readouterr().err


def test_enabling_right_after_disabling_ends_enabled():
    controller = make()
    controller.execute({"cmdName": "disable_robot"})
    controller.execute({"cmdName": "enable_robot"})
    for _ in range(100):
        controller.step(0.008)
    assert controller.state.is_enabled


def some_number(chance):
    return chance.choice([chance.uniform(-180, 180), chance.uniform(-600, 600), chance.uniform(0, 2), 0,
                          chance.randrange(-5, 20), 1e300, -1e9, 1e-300, 360.0])


def some_value(chance, good):
    if chance.random() < 0.03:
        return chance.choice([None, "x", [], {}, True, 1.5, -1, [1, 2, 3]])
    if isinstance(good, list) and good and not isinstance(good[0], list):
        if chance.random() < 0.7:
            return [item + chance.uniform(-20, 20) for item in good]
        return [some_number(chance) for _ in good]
    if isinstance(good, (int, float)) and chance.random() < 0.5:
        return some_number(chance)
    return good


def some_request(chance):
    command = chance.choice(OFTEN) if chance.random() < 0.7 else chance.choice(list(GOOD))
    request = {key: some_value(chance, value) for key, value in GOOD[command][0].items()}
    if command == "jog":
        request = {"jog_mode": chance.randrange(4), "coord_map": chance.randrange(3), "jnum": chance.randrange(6),
                   "jogvel": some_number(chance), "poscmd": some_number(chance)}
    return dict(request, cmdName=command)


@pytest.mark.parametrize("seed, model, firmware", [(1, "zu7", "1.5.14"), (2, "minicobo", "1.7"), (3, "zu3", "1.7")])
def test_random_commands_never_break_it_nor_leave_the_limits(seed, model, firmware, capsys):
    chance, controller = random.Random(seed), make(model, firmware)
    codes = set()
    for _ in range(600):
        outcome = controller.execute(some_request(chance))
        codes.add(json.loads(outcome.reply)["errorCode"])
        state, event = controller.state, chance.random()
        if event < 0.02:
            state.hit(500.0)
        elif event < 0.03:
            state.press_emergency_stop()
            state.release_emergency_stop()
        elif event < 0.07:
            for command in ("clear_error", "power_on", "enable_robot", "stop_program"):
                controller.execute({"cmdName": command})
        elif event < 0.15:
            state.push(chance.randrange(6), chance.uniform(-1.0, 1.0), 0.1)
        elif event < 0.16:
            controller.restart()
        for _ in range(chance.randrange(8)):
            controller.step(0.008)
        frame = controller.feed_frame.text()
        assert json.loads(frame)["len"] == len(frame)
        for angle, (low, high) in zip(controller.state.plant.joint_position, state.model.joint_limits):
            assert low - 1e-3 <= angle <= high + 1e-3
    assert controller.failures == 0, capsys.readouterr().err
    assert {"0", "1", "2"} <= codes


def fingerprint():
    """Return a hash of every reply and frame of a session in virtual time: motion, faults, clients, a restart."""
    chance, controller, told = random.Random(5), make("zu7", "1.7"), hashlib.sha256()
    for turn in range(400):
        outcome = controller.execute(some_request(chance))
        told.update(outcome.reply)
        event = chance.random()
        if event < 0.05:
            chance.choice([controller.state.client_lost, controller.state.client_back,
                           controller.state.client_connected, lambda: controller.state.hit(500.0)])()
        elif event < 0.15:
            for command in ("clear_error", "power_on", "enable_robot"):
                told.update(controller.execute({"cmdName": command}).reply)
        if turn == 300:
            controller.restart()
        for _ in range(chance.randrange(30)):
            controller.step(0.008)
            told.update(b"%d" % (outcome.is_due()))
        told.update(controller.feed_frame.text() + controller.polled_frame.text())
    return told.hexdigest()


def test_the_same_session_gives_the_same_bytes_in_any_process():
    # A caller that sets the time can repeat a session: no clock, no chance, no order of a set is in it.
    paths = os.pathsep.join([str(ROOT), str(ROOT / "test" / "support")])
    seen = {subprocess.run([sys.executable, __file__], env=dict(os.environ, PYTHONPATH=paths, PYTHONHASHSEED=seed),
                           stdout=subprocess.PIPE, check=True, timeout=120).stdout for seed in ("1", "2")}
    assert seen == {fingerprint().encode() + b"\n"}


def test_nothing_in_it_can_ask_for_the_time_or_for_chance():
    assert not outside_imports("jaka_ros_driver.simulation.controller.executor") & {
        "asyncio", "datetime", "queue", "random", "secrets", "select", "selectors", "signal", "socket", "threading",
        "time", "uuid"}


if __name__ == "__main__":
    print(fingerprint())
