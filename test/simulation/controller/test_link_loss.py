"""The reaction to a lost command client where it asked for one; first without sockets, in virtual time, then with."""
import json
import time

import pytest
from raw_client import RawClient
from waiting import wait_until

from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.simulation.arm.plant import CYCLE_TIME_S
from jaka_ros_driver.simulation.controller.executor import Controller
from jaka_ros_driver.simulation.controller.firmware import FIRMWARES
from jaka_ros_driver.simulation.controller.state import LinkLoss, Options, Start

FAR = [170.0, 90.0, -90.0, 90.0, 90.0, 0.0]
PAUSE, ABORT = 1, 2


@pytest.fixture
def controller():
    made = Controller(load_model("zu7"), FIRMWARES["1.5.14"], Options(start=Start.ENABLED))
    made.state.client_connected()
    return made


def ask(controller, command, **parameters):
    outcome = controller.execute(dict(parameters, cmdName=command))
    assert json.loads(outcome.reply)["errorCode"] == "0"


def move(controller):
    ask(controller, "joint_move", jointPosition=FAR, speed=5.0)


def protect(controller, seconds, reaction=ABORT):
    ask(controller, "set_network_exception_handle", motType=reaction, timeLimit=1000.0 * seconds)


def pass_time(controller, seconds):
    for _ in range(round(seconds / CYCLE_TIME_S)):
        controller.step(CYCLE_TIME_S)


def goes_on(controller):
    pass_time(controller, 3.0)
    return controller.state.plant.queue.length == 1 and controller.state.plant.is_moving


def test_lost_client_ends_its_motion_after_its_delay_of_simulated_time(controller):
    protect(controller, 0.4)
    move(controller)
    pass_time(controller, 1.0)
    controller.state.client_lost()
    pass_time(controller, 0.392)
    assert controller.state.plant.queue.length == 1
    pass_time(controller, 0.016)
    assert controller.state.plant.queue.length == 0
    pass_time(controller, 1.0)
    assert not controller.state.plant.is_moving


def test_lost_client_pauses_where_it_asked_for_that(controller):
    protect(controller, 0.1, PAUSE)
    move(controller)
    controller.state.client_lost()
    pass_time(controller, 1.0)
    assert controller.state.is_paused and not controller.state.plant.is_moving
    assert controller.state.plant.queue.length == 1


@pytest.mark.parametrize("reaction", [PAUSE, ABORT])
def test_lost_client_ends_its_jog_where_it_asked_for_a_pause_or_an_abort(controller, reaction):
    protect(controller, 0.1, reaction)
    ask(controller, "jog", jog_mode=1, coord_map=1, jnum=0, jogvel=10.0)
    pass_time(controller, 0.5)
    assert controller.state.plant.is_moving
    controller.state.client_lost()
    pass_time(controller, 1.0)
    assert not controller.state.plant.is_moving
    controller.state.client_connected()
    controller.execute({"cmdName": "resume_program"})
    pass_time(controller, 1.0)
    assert not controller.state.plant.is_moving


def test_without_a_wish_motion_survives_its_client(controller):
    move(controller)
    controller.state.client_lost()
    assert goes_on(controller)


def test_setting_ends_with_its_client(controller):
    protect(controller, 0.1)
    controller.state.client_lost()
    controller.state.client_connected()
    assert (controller.state.link_loss, controller.state.link_loss_delay) == (LinkLoss.KEEP, 0.0)
    move(controller)
    controller.state.client_lost()
    assert goes_on(controller)


def test_next_client_is_not_stopped_by_the_timer_of_the_last(controller):
    protect(controller, 0.3)
    controller.state.client_lost()
    pass_time(controller, 0.1)
    controller.state.client_connected()
    move(controller)
    assert goes_on(controller)


def test_client_that_is_replaced_is_not_lost(controller):
    protect(controller, 0.0)
    move(controller)
    controller.state.client_connected()
    assert goes_on(controller)


def test_client_that_is_back_in_time_is_not_lost_and_keeps_its_setting(controller):
    protect(controller, 0.3)
    move(controller)
    controller.state.client_lost()
    pass_time(controller, 0.25)
    controller.state.client_back()
    assert goes_on(controller)
    controller.state.client_lost()
    pass_time(controller, 0.32)
    assert controller.state.plant.queue.length == 0


def test_loss_told_again_does_not_begin_anew(controller):
    protect(controller, 0.3)
    move(controller)
    controller.state.client_lost()
    pass_time(controller, 0.2)
    controller.state.client_lost()
    pass_time(controller, 0.12)
    assert controller.state.plant.queue.length == 0


def test_client_that_was_back_too_late_can_be_lost_once_more(controller):
    protect(controller, 0.3)
    move(controller)
    controller.state.client_lost()
    pass_time(controller, 1.0)
    controller.state.client_back()
    move(controller)
    assert goes_on(controller)
    controller.state.client_lost()
    pass_time(controller, 0.32)
    assert controller.state.plant.queue.length == 0


def test_restart_forgets_it(controller):
    protect(controller, 0.3)
    controller.state.client_lost()
    controller.restart()
    assert controller.state.link_loss is LinkLoss.KEEP


# --- over sockets, where the arm is twenty times faster than time -----------------------------------------------------


def connected(arm):
    return sum(1 for c in arm.operate("wire")["wire"]["connections"] if c["port"] == "command" and not c["half_open"])


def send_far(client):
    assert client.code("joint_move", jointPosition=FAR, speed=2.0) == "0"


def ask_for_abort(client, simulated_s):
    assert client.code("set_network_exception_handle", motType=ABORT, timeLimit=1000.0 * simulated_s) == "0"


def still_moves_after(arm, simulated_s):
    began = arm.state()["simulated_s"]
    wait_until(lambda: arm.state()["simulated_s"] > began + simulated_s, "time to pass")
    return arm.state()["is_moving"] and arm.state()["queue_length"] == 1


def wait_for_abort(arm):
    wait_until(lambda: not arm.state()["is_moving"] and arm.state()["queue_length"] == 0, "the abort")
    assert arm.state()["joint_position"][0] < 169.0


def test_next_client_begins_without_a_setting_and_without_a_timer(arm):
    with RawClient(arm.command_port) as first:
        ask_for_abort(first, 6.0)
    wait_until(lambda: connected(arm) == 0, "the first to be gone")
    with RawClient(arm.command_port) as second:
        send_far(second)
        assert still_moves_after(arm, 10.0)
    wait_until(lambda: connected(arm) == 0, "the second to be gone")
    assert still_moves_after(arm, 10.0)


def test_newer_client_in_place_of_one_that_asked_for_abort(make_arm):
    arm = make_arm(single_client="replace")
    with RawClient(arm.command_port) as first:
        ask_for_abort(first, 0.0)
        send_far(first)
        with RawClient(arm.command_port) as second:
            assert second.code("get_version") == "0" and first.is_closed()
            assert still_moves_after(arm, 5.0)


@pytest.mark.parametrize("how", ["panel", "fault"])
def test_half_open_connection_is_a_lost_client(arm, client, how):
    ask_for_abort(client, 1.0)
    send_far(client)
    assert still_moves_after(arm, 2.0)
    if how == "panel":
        arm.operate("half_open", port="command")
    else:
        arm.operate("fault", kind="half_open", port="command")
        client.send(b'{"cmdName": "get_version"}')
    wait_for_abort(arm)


def test_client_behind_a_half_open_one_is_lost_when_it_goes(arm, client):
    ask_for_abort(client, 6.0)
    send_far(client)
    arm.operate("half_open", port="command")
    with RawClient(arm.command_port) as second:
        assert second.code("get_version") == "0"
        assert still_moves_after(arm, 10.0)
        ask_for_abort(second, 1.0)
    wait_for_abort(arm)


def test_stall_that_outlasts_the_delay_is_a_lost_client(arm, client):
    ask_for_abort(client, 2.0)
    send_far(client)
    arm.operate("stall", port="command", duration_ms=1500)
    wait_for_abort(arm)
    assert client.code("get_version") == "0"  # it is served once the stall has ended, and its setting stands
    send_far(client)
    client.close()
    wait_for_abort(arm)


def test_stall_that_ends_before_the_delay_is_none(arm, client):
    ask_for_abort(client, 10.0)
    send_far(client)
    arm.operate("stall", duration_ms=100)
    assert client.code("get_version") == "0"
    assert still_moves_after(arm, 15.0)


def test_stall_that_is_prolonged_counts_from_its_beginning(arm, client):
    ask_for_abort(client, 8.0)
    send_far(client)
    began = arm.state()["simulated_s"]
    while arm.state()["queue_length"]:
        arm.operate("stall", port="command", duration_ms=1000)
        assert arm.state()["simulated_s"] - began < 16.0
        time.sleep(0.02)  # between two prolongations
    wait_for_abort(arm)


def test_stall_and_half_open_of_the_feed_lose_no_client(arm, client, feed):
    ask_for_abort(client, 0.5)
    send_far(client)
    arm.operate("stall", port="status", duration_ms=300)
    arm.operate("half_open", port="status")
    assert still_moves_after(arm, 10.0)


def test_stall_without_a_client_does_not_bring_the_lost_one_back(arm):
    with RawClient(arm.command_port) as client:
        ask_for_abort(client, 10.0)
        send_far(client)
    wait_until(lambda: connected(arm) == 0, "the client to be gone")
    arm.operate("stall", port="command", duration_ms=20)
    assert still_moves_after(arm, 1.0)
    wait_for_abort(arm)
