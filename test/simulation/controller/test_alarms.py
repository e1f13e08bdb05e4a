"""The values of errcode, and how long each lasts (docs/controller-protocol.md section 4.4)."""
import pytest

from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.simulation.arm import events
from jaka_ros_driver.simulation.controller import alarms
from jaka_ros_driver.simulation.controller.firmware import FIRMWARES
from jaka_ros_driver.simulation.controller.memory import Memory
from jaka_ros_driver.simulation.controller.state import ControllerState, Options, Start

NOTHING = (0, "")


@pytest.mark.parametrize("event", [
    events.LINEAR_MOVE_FAILED, events.SINGULARITY, events.HAND_GUIDING_HIT_SOFT_LIMIT,
    alarms.COLLISION, events.joint_collision(2)])
def test_errors_stand_until_they_are_cleared(event):
    shown = alarms.Alarms()
    shown.raise_event(event, 1.0)
    shown.left_soft_limit()
    shown.drives_enabled()
    assert shown.shown() == (event.code, event.text)
    shown.raise_event(alarms.COLLISION, 2.0)
    assert shown.shown() == (event.code, event.text)  # the first one stays
    shown.clear(False)
    assert shown.shown() == NOTHING
    assert [noted for _, noted in shown.past] == [event, alarms.COLLISION]


@pytest.mark.parametrize("event", [events.near_soft_limit(1, True), events.overspeed(3)])
def test_warnings_are_kept_but_not_shown(event):
    shown = alarms.Alarms()
    shown.raise_event(event, 1.0)
    assert shown.shown() == NOTHING and shown.past[0] == (1.0, event)


@pytest.mark.parametrize("event, code", [
    (events.on_soft_limit(0, True), 0x31), (events.on_soft_limit(2, False), 0x20032),
    (events.jog_beyond_limit(5, True), 0x50035)])
def test_limits_are_shown_while_the_arm_is_there(event, code):
    shown = alarms.Alarms()
    shown.raise_event(event, 1.0)
    assert shown.shown()[0] == code
    shown.clear(False)
    assert shown.shown()[0] == code
    shown.left_soft_limit()
    assert shown.shown() == NOTHING


def test_emergency_stop_is_shown_above_all_until_released_and_cleared():
    shown = alarms.Alarms()
    for event in (alarms.DISABLED_NOTE, alarms.COLLISION, alarms.EMERGENCY_STOP):
        shown.raise_event(event, 1.0)
    assert shown.shown()[0] == 0x309082
    shown.clear(True)
    assert shown.shown()[0] == 0x309082
    shown.clear(False)
    assert shown.shown() == NOTHING


def test_list_of_past_events_is_bounded():
    shown = alarms.Alarms()
    for number in range(1000):
        shown.raise_event(alarms.COLLISION, float(number))
    assert len(shown.past) == 200 and shown.past[-1][0] == 999.0


def test_singularity_is_a_protective_stop(monkeypatch):
    state = ControllerState(load_model("zu7"), FIRMWARES["1.5.14"], Options(start=Start.ENABLED), Memory())
    told = [[events.SINGULARITY_PROTECTIVE_STOP]]
    monkeypatch.setattr(state.plant, "take_events", lambda: told.pop() if told else [])
    state.step(0.008)
    assert state.protective_stop and state.alarms.shown()[0] == 0x0F0018
    state.clear_error()
    assert not state.protective_stop and state.alarms.shown() == NOTHING


def test_line_that_leaves_the_reach_ends_with_an_event():
    # From one side of the base to the other, the straight line passes through it.
    state = ControllerState(load_model("zu7"), FIRMWARES["1.5.14"], Options(start=Start.ENABLED), Memory())
    home = state.plant.tcp_pose()
    x, y, z = home.position
    state.plant.add_linear_move(type(home)((-x, -y, z), home.rpy), 0.5)
    for _ in range(2000):
        state.step(0.008)
        if state.alarms.shown()[0]:
            break
    assert state.alarms.shown()[0] in (events.LINEAR_MOVE_FAILED.code, events.SINGULARITY_PROTECTIVE_STOP.code)
    assert state.plant.queue.length == 0
