"""Power, enabling and alarms: the requests sent to an arm with a fault, and the evidence that they are done."""
import pytest
from stories import HOME, Story

from jaka_ros_driver.client.core.actions import Port
from jaka_ros_driver.client.core.procedures import power, recovery
from jaka_ros_driver.commands import JointMove
from jaka_ros_driver.errors import InvalidCommand, MotionInterrupted, StopCause

SWITCHES = {"power_on", "enable_robot"}
OFF = {"powered_on": 0, "enabled": False}


def asked(procedure, **fields):
    """Return a story in which a procedure of ``power`` was begun on an arm of this state."""
    story = Story()
    story.fields.update(fields)
    story.run(0.1)
    story.core.run("call", procedure(story.core), story.now)
    story.perform()
    return story


def auto_enable(core):
    return power.auto_enable(core, core.disturbances - core.link_losses)


def switches(story):
    return [name for name in story.names() if name in SWITCHES]


def test_a_stop_that_stands_when_the_arm_is_first_seen_is_none_that_comes():
    story = Story(ready=False)
    story.fields["emergency_stop"] = 1
    story.connect()
    story.run(0.1)
    assert story.core.state.emergency_stop and not story.core.last_disturbance
    story.fields["protective_stop"] = 1
    story.run(0.05)
    assert story.core.last_disturbance == "the arm was stopped or has a fault"


@pytest.mark.parametrize("procedure", [lambda core: power.set_power(core, True),
                                       lambda core: power.set_enabled(core, True)])
@pytest.mark.parametrize("stop", ["emergency_stop", "protective_stop"])
def test_nothing_is_switched_on_under_a_stop(procedure, stop):
    story = asked(procedure, enabled=False, powered_on=0, **{stop: 1})
    assert isinstance(story.error("call"), InvalidCommand) and not switches(story)


def test_power_counts_as_on_when_the_arm_reports_it_and_not_when_it_is_accepted():
    story = asked(lambda core: power.set_power(core, True), **OFF).run(0.5)
    assert switches(story) == ["power_on"] and story.error("call") == "pending"
    story.fields["powered_on"] = 1
    assert story.run(0.05).error("call") is None


def test_only_a_state_of_after_the_question_answers_it():
    story = Story()
    story.core.run("call", story.core.seen(lambda state: state.is_enabled, 1.0), story.now)
    story.core.tick(story.now)
    story.perform()
    assert story.error("call") == "pending"
    assert story.run(0.008).error("call") is None


def test_an_alarm_that_stands_again_is_not_cleared():
    story = asked(power.clear_error, errcode="0xf0034").run(2.9)
    assert story.count("clear_error") == 1 and story.error("call") == "pending"
    story.run(0.2)
    assert story.cause("call") is StopCause.FAULT and "0xF0034" in str(story.error("call"))


def test_clearing_tells_what_is_still_missing():
    story = asked(power.clear_error, errcode="0xf0034", **OFF)
    story.fields["errcode"] = "0x0"
    story.run(0.05)
    assert story.answers["call"][1:] == (("alarms cleared", ["power", "enable"]), None)


@pytest.mark.parametrize("illness", [{"emergency_stop": 1}, {"protective_stop": 1}, {"errcode": "0xf0034"}])
def test_a_sick_arm_is_not_powered_by_itself(illness):
    story = asked(auto_enable, **OFF, **illness).run(0.5)
    assert not switches(story)


def test_a_healthy_arm_is_powered_and_enabled_once():
    story = asked(auto_enable, **OFF).run(0.2)
    story.fields["powered_on"] = 1
    story.run(0.2)
    story.fields["enabled"] = True
    story.run(0.2)
    story.fields.update(OFF)
    story.run(0.5)
    assert switches(story) == ["power_on", "enable_robot"]


@pytest.mark.parametrize("disturb", [
    lambda story: story.core.stop("stop", story.now), lambda story: story.run(0.02, protective_stop=1),
    lambda story: story.core.run("other", power.clear_error(story.core), story.now)])
def test_what_disturbs_the_powering_ends_it_for_good(disturb):
    story = asked(auto_enable, **OFF).run(0.2)
    disturb(story)
    story.run(0.1)
    story.fields["powered_on"] = 1
    story.run(0.5)
    assert switches(story) == ["power_on"]


@pytest.mark.parametrize("before, worse", [
    ({"powered_on": 0, "enabled": True}, {"enabled": False}),
    ({"powered_on": 1, "enabled": False}, {"powered_on": 0})], ids=["disabled", "no power"])
def test_drives_that_go_off_meanwhile_end_the_powering_for_good(before, worse):
    story = asked(auto_enable, **before).run(0.1)
    begun = switches(story)
    assert len(begun) == 1
    story.run(0.05, **worse)
    story.fields.update(powered_on=1, enabled=False)
    story.run(0.5)
    assert switches(story) == begun and "drives went off" in story.core.last_disturbance


def unseen():
    """Return a story in which the arm, whose drives are off, is to be powered as soon as it is seen."""
    story = Story(ready=False)
    story.fields.update(OFF)
    story.core.run(None, power.auto_enable(story.core, 0), story.now)
    story.perform()
    return story


CALLS_OFF = [lambda story: story.core.stop("stop", story.now), *[
    lambda story, procedure=procedure: story.core.run("call", procedure(story.core), story.now) for procedure in (
        lambda core: power.set_power(core, False), lambda core: power.set_enabled(core, False), power.clear_error)]]


@pytest.mark.parametrize("ports", [(), (Port.COMMAND,), (Port.STATUS,)])
@pytest.mark.parametrize("call_off", CALLS_OFF, ids=["stop", "power off", "disable", "clear_err"])
def test_what_was_asked_for_before_the_arm_is_seen_ends_the_powering_for_good(call_off, ports):
    story = unseen()
    for port in ports:
        story.core.opened(port, story.now)
        story.perform()
    call_off(story)
    story.perform()
    for port in (Port.COMMAND, Port.STATUS):
        if port not in ports:
            story.core.opened(port, story.now)
            story.perform()
    story.run(0.5)
    assert story.core.is_ready(story.now) and not switches(story)
    assert [text for text in story.log if text.startswith("auto_enable")] == [
        "auto_enable: a stop, a call or a fault came before the arm was seen, and it is left as it is"]


def test_a_stop_between_the_drivers_begin_and_its_auto_enable_ends_the_powering_too():
    story = Story(ready=False)
    story.fields.update(OFF)
    story.core.stop("stop", story.now)
    story.core.run(None, power.auto_enable(story.core, 0), story.now)
    story.connect()
    story.run(0.5)
    assert story.core.is_ready(story.now) and not switches(story)


def test_a_stop_at_the_controller_before_the_handshake_is_done_ends_the_powering_for_good():
    story = unseen()
    story.core.opened(Port.STATUS, story.now)
    story.perform()
    story.run(0.1).run(0.1, emergency_stop=1).run(0.1)
    story.core.opened(Port.COMMAND, story.now)
    story.perform()
    story.run(0.5)
    assert story.core.is_ready(story.now) and not switches(story)


def test_an_arm_whose_controller_starts_late_and_whose_links_flap_is_powered_and_enabled_once():
    story = unseen()
    for _ in range(3):
        story.core.failed(Port.COMMAND, "connection refused", story.now)
        story.run(1.0)
    for _ in range(3):
        story.core.opened(Port.COMMAND, story.now)
        story.perform()
        story.core.closed(Port.COMMAND, "cut", story.now)
        story.core.opened(Port.STATUS, story.now)
        story.perform()
        story.run(0.1)
        story.core.closed(Port.STATUS, "cut", story.now)
        story.feed = False
        story.run(1.0)
        story.feed = True
    assert story.core.link_losses >= 3 and not switches(story)
    story.connect()
    story.run(0.2)
    story.fields["powered_on"] = 1
    story.run(0.2)
    assert switches(story) == ["power_on", "enable_robot"]


def test_an_arm_without_drives_is_not_moved():
    for fields in (OFF, {"enabled": False}, {"emergency_stop": 1}, {"protective_stop": 1}):
        story = Story()
        story.fields.update(fields)
        story.run(0.1)
        story.core.move("move", JointMove((0.5,) + HOME[1:], 1.0, 1.0), True, story.now)
        story.perform()
        assert isinstance(story.error("move"), InvalidCommand) and story.count("joint_move") == 0


def test_hand_guiding_that_the_feed_does_not_tell_excludes_motion_until_it_is_switched_off():
    story = Story()
    for active in (True, False):
        story.core.hand_guiding_was_set(active)
        story.core.move(active, JointMove((0.5,) + HOME[1:], 1.0, 1.0), True, story.now)
        story.perform()
    assert isinstance(story.error(True), InvalidCommand) and story.error(False) == "pending"


def test_disabling_in_mid_move_stops_the_arm_and_waits_for_its_rest():
    story = Story()
    story.core.move("move", JointMove((0.5,) + HOME[1:], 1.0, 1.0), True, story.now)
    story.run(0.3, move=0.5, inpos=False)
    story.core.run("call", power.set_enabled(story.core, False), story.now)
    story.run(0.1, move=0.5, inpos=False)
    assert story.count("stop_program") == 1 and story.count("disable_robot") == 0
    story.run(0.2)
    assert story.count("disable_robot") == 1 and isinstance(story.error("move"), MotionInterrupted)


@pytest.mark.parametrize("on, off, requests, state", [
    (power.set_power, power.set_power, ["power_on", "power_off"], OFF),
    (power.set_enabled, power.set_enabled, ["enable_robot", "disable_robot"], {"enabled": False}),
    (power.set_enabled, power.set_power, ["enable_robot", "disable_robot", "power_off"], {"enabled": False})])
def test_drives_that_are_coming_on_are_switched_off_though_they_are_off_still(on, off, requests, state):
    # Else the call would be answered "off", and they would come on behind it.
    story = asked(lambda core: on(core, True), **state).run(0.2)
    story.core.run("off", off(story.core, False), story.now)
    story.run(0.3)
    story.fields["powered_on"] = 0
    story.run(0.3)
    assert [name for name in story.names() if name in ("power_on", "power_off", "enable_robot", "disable_robot")
            ] == requests
    assert story.error("off") is None


def test_drives_that_are_off_are_not_switched_off_again():
    story = asked(lambda core: power.set_power(core, False), **OFF).run(0.3)
    assert story.error("call") is None and not {"power_off", "disable_robot"} & set(story.names())


@pytest.mark.parametrize("event, is_ready", [("0x020031", True), ("0x050036", True), ("0x060031", False),
                                             ("0x027a31", False)])
def test_recovery_leaves_the_event_of_a_joint_on_its_soft_limit_standing_and_no_other(event, is_ready):
    # The joint has to be moved away, which the arm lets happen; another event stands against every motion.
    story = Story()
    story.fields["errcode"] = event
    story.run(0.1)
    story.core.run("recover", recovery.recover(story.core), story.now)
    story.perform()
    story.run(10.0)
    if is_ready:
        assert "stands until the joint is moved away" in story.answers["recover"][1]
    else:
        assert story.cause("recover") is StopCause.FAULT
    assert story.count("clear_error") == 1


@pytest.mark.parametrize("other", [lambda core: power.set_power(core, False), lambda core: recovery.recover(core)],
                         ids=["another call", "a second recovery"])
def test_another_call_ends_a_recovery_and_a_second_recovery_is_refused(other):
    story = Story()
    story.fields["errcode"] = "0x7abcde"
    story.run(0.1)
    story.core.run("recover", recovery.recover(story.core), story.now)
    story.run(0.5)
    story.core.run("other", other(story.core), story.now)
    story.run(0.1)
    if isinstance(story.error("other"), InvalidCommand):
        assert "another recovery is running" in str(story.error("other")) and story.error("recover") == "pending"
    else:
        assert isinstance(story.error("recover"), recovery.RecoveryInterrupted)


def recovering_while_it_moves(move):
    """Return a story in which a recovery is requested while joint 1 goes to ``move``, rad."""
    story = Story()
    story.fields["protective_stop"] = 1
    story.run(0.2, move=move)
    story.core.run("call", recovery.recover(story.core), story.now)
    story.perform()
    return story


def test_an_arm_that_moves_is_not_recovered_and_nothing_is_sent():
    story = recovering_while_it_moves(3.0).run(2.2, move=3.0)
    assert story.error("call") == "pending" and not story.count("clear_error")
    story.run(0.2, move=3.0)
    assert isinstance(story.error("call"), InvalidCommand) and "not by this driver" in str(story.error("call"))
    assert not story.count("clear_error") and not switches(story)


def test_an_arm_that_comes_to_rest_in_time_is_recovered_then():
    story = recovering_while_it_moves(0.3).run(0.4, move=0.3)
    assert not story.count("clear_error"), "it has moved until now"
    story.run(0.5)
    assert story.count("clear_error") == 1 and story.error("call") == "pending"
    story.fields["protective_stop"] = 0
    assert story.run(0.5).error("call") is None


@pytest.mark.parametrize("fields, missing", [
    ({}, []), ({"protective_stop": 1}, ["clear_err"]), ({"errcode": "0xf0017"}, ["clear_err"]),
    ({"emergency_stop": 1, "protective_stop": 1, "powered_on": 0, "enabled": False},
     ["release the emergency stop", "clear_err", "power", "enable"])])
def test_what_is_missing_is_told_in_the_order_in_which_it_is_to_be_done(fields, missing):
    story = Story()
    story.fields.update(fields)
    story.run(0.1)
    assert power.missing_for_motion(story.core.state) == missing


@pytest.mark.parametrize("fields, event", [({}, "no event"), ({"errcode": "0x10f0001"}, "event 0x10F0001")])
def test_an_arm_that_does_not_follow_is_told_with_its_event(fields, event):
    story = asked(lambda core: power.set_power(core, True), **OFF, **fields).run(70.0)
    assert isinstance(story.error("call"), MotionInterrupted) and "(%s)" % event in str(story.error("call"))
