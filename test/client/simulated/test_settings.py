"""Settings that are read back, from the simulated controller in virtual time."""
import pytest
from simulated_arm import SimulatedArm

from jaka_ros_driver import commands as c
from jaka_ros_driver.client.core.motion import MotionOwner
from jaka_ros_driver.client.core.procedures import settings as procedures
from jaka_ros_driver.client.core.procedures.steps import Ask
from jaka_ros_driver.errors import CommandRejected, InvalidCommand
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.simulation.arm.plant import HOME
from jaka_ros_driver.state import IoBank

MODEL = load_model("zu7")
EXCLUSIVE = ("set_tool_frame", "set_user_frame", "set_payload", "set_hand_guiding", "zero_force_sensor")


class Settings:
    """The procedures as functions of an arm."""

    ReadBackMismatch = procedures.ReadBackMismatch
    NOT_VERIFIED = procedures.NOT_VERIFIED

    def __getattr__(self, name):
        def act(arm, *args):
            return arm.does(lambda core: getattr(procedures, name)(core, *args),
                            MotionOwner.SETTING if name in EXCLUSIVE else None)
        return act


settings = Settings()
POSE = c.Pose((0.01, -0.02, 0.12), (0.1, -0.2, 0.3))
JOG = c.Jog(c.JogFrame.JOINT, 0, 0.1)


def simulated(**options):
    return SimulatedArm(MODEL, HOME, has_all_fields=True, **options)


def jogged(arm):
    assert arm.ended(arm.begin("jog", JOG)) is None


def test_tool_and_user_frames_are_stored_read_back_and_active():
    arm = simulated()
    assert settings.set_tool_frame(arm, c.SetToolFrame(2, POSE, "gripper"), True) == (
        "tool 2 set and active; the active tool is now 2, and was 0")
    assert settings.set_tool_frame(arm, c.SetToolFrame(2, POSE, "gripper"), True) == "tool 2 set and active"
    assert settings.set_user_frame(arm, c.SetUserFrame(3, POSE, "table"), True) == (
        "user frame 3 set and active; the active user frame is now 3, and was 0")
    assert settings.set_user_frame(arm, c.SetUserFrame(3, POSE, "table"), True) == "user frame 3 set and active"
    assert (arm.state.tool_id, arm.state.user_frame_id) == (2, 3)
    assert settings.set_tool_frame(arm, c.SetToolFrame(4, POSE, "other"), False) == "tool 4 set"
    assert arm.controller.state.memory.tools.active == 2


def test_held_settings_are_those_of_the_controller_and_what_it_does_not_tell_is_none():
    arm = simulated()
    settings.set_user_frame(arm, c.SetUserFrame(3, POSE, "table"), True)
    settings.set_payload(arm, 1, c.SetPayload(1.5, (0.0, 0.0, 0.05)))
    settings.set_collision_level(arm, 2)
    held = settings.held(arm)
    assert (held.tool_id, held.user_frame_id, held.collision_level) == (1, 3, 2)
    assert held.payload == c.SetPayload(1.5, (0.0, 0.0, 0.05))
    assert held.user_frames[3].position == pytest.approx(POSE.position)
    assert held.user_frames[3].rpy == pytest.approx(POSE.rpy)
    procedure = procedures.held(arm.core)
    question = next(procedure)
    while question.command is not c.Query.PAYLOAD:
        question = procedure.send(())
    assert procedure.throw(CommandRejected("get_payload", 1, "unknown")).command is c.Query.COLLISION_LEVEL


def test_payload_and_collision_level_are_read_back():
    arm = simulated()
    load = c.SetPayload(1.5, (0.0, 0.0, 0.05))
    assert settings.set_payload(arm, 1, load) == (
        "payload of tool 1 set: 1.5 kg; the active tool is now 1, and was 0")
    assert settings.set_payload(arm, 1, load) == "payload of tool 1 set: 1.5 kg"
    assert settings.set_collision_level(arm, 4) == "collision level 4"
    assert settings.set_collision_level(arm, 0) == "collision detection off"
    assert arm.controller.state.memory.payload.mass == 1.5 and arm.controller.state.memory.collision_level == 0


@pytest.mark.parametrize("bank", [IoBank.CABINET, IoBank.TOOL, IoBank.EXTENSION])
def test_outputs_are_seen_set(bank):
    arm = simulated()
    for value in (True, False):
        assert "digital output 1 of %s is %d" % (bank.name.lower(), value) in settings.set_digital_output(
            arm, c.SetDigitalOutput(bank, 1, value))


@pytest.mark.parametrize("firmware, base", [("1.5.14", None), ("1.7.2", None), ("1.5.14", 1), ("1.7.1", 0)])
def test_outputs_are_counted_as_the_controller_counts_them(firmware, base):
    dialect = {} if base is None else {"io_index_base": base}
    arm = simulated(firmware=firmware, dialect=dialect, io_index_base=base)
    settings.set_digital_output(arm, c.SetDigitalOutput(IoBank.CABINET, 3, True))
    settings.set_analog_output(arm, c.SetAnalogOutput(IoBank.CABINET, 5, 2.5))
    io = arm.state.io
    assert io.digital_outputs[IoBank.CABINET].index(1) == 3 and io.analog_outputs[IoBank.CABINET].index(2.5) == 5
    told = settings.set_digital_output(arm, c.SetDigitalOutput(IoBank.EXTENSION, 7, True))  # the feed lacks this bank
    assert told == "digital output 7 of extension is 1"
    assert arm.does(lambda core: core.ask(c.GetDigitalOutput(IoBank.EXTENSION, 7))) is True


@pytest.mark.parametrize("driver, controller, other", [(0, 1, 2), (1, 0, 4)])
def test_another_output_than_the_asked_one_is_an_error_that_names_both(driver, controller, other):
    arm = simulated(dialect={"io_index_base": controller}, io_index_base=driver)
    both = "accepted output 3 and set output %d instead: .*io_index_base" % other

    def set_it(value):
        settings.set_digital_output(arm, c.SetDigitalOutput(IoBank.CABINET, 3, value))
    with pytest.raises(settings.ReadBackMismatch, match=both):
        set_it(True)
    with pytest.raises(settings.ReadBackMismatch, match="the output is 0"):
        set_it(True)  # nothing changes any more
    with pytest.raises(settings.ReadBackMismatch, match=both):
        set_it(False)  # the asked one has that value already
    with pytest.raises(settings.ReadBackMismatch, match=both):
        settings.set_analog_output(arm, c.SetAnalogOutput(IoBank.CABINET, 3, 1.5))


def test_the_value_of_the_first_output_is_told_where_it_does_not_change():
    arm = simulated(dialect={"io_index_base": 0}, io_index_base=1)
    for told in ("set output 1 instead", "the output is 0$"):
        with pytest.raises(settings.ReadBackMismatch, match=told):
            settings.set_digital_output(arm, c.SetDigitalOutput(IoBank.CABINET, 0, True))


@pytest.mark.parametrize("driver, controller, seen", [(0, 0, 3), (0, 1, 2), (1, 0, 4), (1, 1, 3)])
def test_with_the_makers_indices_the_terminal_that_changes_is_meant_and_logged_once(
        driver, controller, seen, monkeypatch):
    arm = simulated(dialect={"io_index_base": controller}, io_index_base=driver, takes_io_as_counted=True)
    logged = []
    monkeypatch.setattr(arm.core.actions, "log", lambda level, text: logged.append(text))
    for _ in range(2):
        for value in (True, False):
            settings.set_digital_output(arm, c.SetDigitalOutput(IoBank.CABINET, 3, value))
            assert arm.state.io.digital_outputs[IoBank.CABINET][seen] == value
    settings.set_analog_output(arm, c.SetAnalogOutput(IoBank.CABINET, 3, 1.5))
    assert arm.state.io.analog_outputs[IoBank.CABINET][seen] == 1.5
    said, = [text for text in logged if "the first output" in text]
    assert "index 3 of cabinet, on the wire %d" % (3 + driver) in said
    assert said.endswith("changed terminal %d from 0 to 1" % seen)


def test_an_output_that_is_set_already_may_be_set_again():
    arm = simulated()
    for _ in range(3):
        assert settings.set_digital_output(arm, c.SetDigitalOutput(IoBank.CABINET, 3, True)).endswith("is 1")


def test_an_analog_output_is_seen_set():
    arm = simulated()
    told = settings.set_analog_output(arm, c.SetAnalogOutput(IoBank.CABINET, 0, 4.5))
    assert told == "analog output 0 of cabinet is 4.5"


@pytest.mark.parametrize("beside, is_taken", [(0.005, True), (-0.005, True), (0.05, False), (-0.8, False)])
def test_an_analog_output_may_read_a_hundredth_beside_its_value(beside, is_taken):
    arm = simulated()
    arm.show(aout=[4.5 + beside] + [0.0] * 7)
    command = c.SetAnalogOutput(IoBank.CABINET, 0, 4.5)
    if is_taken:
        assert settings.set_analog_output(arm, command) == "analog output 0 of cabinet is 4.5"
    else:
        with pytest.raises(settings.ReadBackMismatch, match="the output is %g" % (4.5 + beside)):
            settings.set_analog_output(arm, command)


def test_hand_guiding_is_seen_on_and_off():
    arm = simulated()
    assert settings.set_hand_guiding(arm, True) == "hand guiding on"
    assert settings.set_hand_guiding(arm, True) == "hand guiding on"
    assert settings.set_hand_guiding(arm, False) == "hand guiding off"


def test_hand_guiding_is_refused_while_something_moves_the_arm():
    arm = simulated()
    jogged(arm)
    with pytest.raises(InvalidCommand, match="a jog owns"):
        settings.set_hand_guiding(arm, True)
    assert arm.times_of("torque_control_enable") == []


def test_the_force_sensor_is_seen_to_read_zero():
    arm = simulated(has_force_sensor=True)
    arm.controller.state.force_sensor.load((10.0, 0.0, 0.0, 0.0, 0.0, -1.0))
    arm.run(0.1)
    assert arm.state.wrench == (10.0, 0.0, 0.0, 0.0, 0.0, -1.0)
    assert settings.zero_force_sensor(arm) == "the force sensor reads zero"
    assert arm.state.wrench == (0.0,) * 6


@pytest.mark.parametrize("reading, is_zero", [
    ([0.5, -0.5, 0.5, 0.05, -0.05, 0.05], True), ([0.0, 0.0, 3.0, 0.0, 0.0, 0.0], False),
    ([0.0, 0.0, 0.0, 0.0, 0.0, 0.3], False)])
def test_the_noise_of_a_sensor_at_rest_reads_zero_and_what_is_more_does_not(reading, is_zero):
    arm = simulated(has_force_sensor=True)
    arm.show(torqsensor=[[], [0, 0, reading, [1.0] * 6, [1.0] * 6]])
    arm.run(0.1)
    if is_zero:
        assert settings.zero_force_sensor(arm) == "the force sensor reads zero"
    else:
        with pytest.raises(settings.ReadBackMismatch, match="accepted it but the sensor reads"):
            settings.zero_force_sensor(arm)


def test_a_sensor_that_goes_on_reading_a_load_is_told():
    arm = simulated(has_force_sensor=True)
    arm.controller.state.force_sensor.load((10.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    arm.run(0.1)
    changed = Changed(arm, lambda command: () if isinstance(command, c.ZeroForceSensor) else None)
    with pytest.raises(settings.ReadBackMismatch, match="accepted it but the sensor reads 10 0 0 N, 0 0 0 N m"):
        settings.zero_force_sensor(changed)


@pytest.mark.parametrize("shown, told", [
    ({}, "shows no force sensor"), ({"torqsensor": [[], [0, 17, [1.0] * 6, [1.0] * 6]]}, "reports error 17")])
def test_a_sensor_that_is_not_there_or_has_failed_is_not_zeroed(shown, told):
    arm = simulated()
    arm.show(**shown)
    arm.run(0.1)
    with pytest.raises(InvalidCommand, match=told):
        settings.zero_force_sensor(arm)
    assert not arm.times_of("zero_end_sensor")


def test_the_force_sensor_is_not_zeroed_while_something_moves_the_arm():
    arm = simulated(has_force_sensor=True)
    jogged(arm)
    with pytest.raises(InvalidCommand, match="a jog owns"):
        settings.zero_force_sensor(arm)
    assert not arm.times_of("zero_end_sensor")


class Changed:
    """An arm whose controller answers some commands by itself: they never get there."""

    def __init__(self, arm, answer):
        self._arm = arm
        self._answer = answer

    def does(self, procedure, exclusive=None):
        return self._arm.does(lambda core: self._filtered(procedure(core)), exclusive)

    def _filtered(self, steps):
        resume, value = steps.send, None
        while True:
            try:
                step = resume(value)
                if isinstance(step, Ask) and self._answer(step.command) is not None:
                    kept = self._answer(step.command)
                    resume, value = (steps.throw, kept) if isinstance(kept, Exception) else (steps.send, None)
                    continue
            except StopIteration as end:
                return end.value
            try:
                resume, value = steps.send, (yield step)
            except Exception as error:
                resume, value = steps.throw, error


def forgetful(arm, forgets):
    """Return an arm whose controller accepts a setting and does not keep it."""
    return Changed(arm, lambda command: "accepted" if isinstance(command, forgets) else None)


@pytest.mark.parametrize("forgets, act", [
    (c.SetToolFrame, lambda arm: settings.set_tool_frame(arm, c.SetToolFrame(2, POSE, "t"), True)),
    (c.SelectTool, lambda arm: settings.set_tool_frame(arm, c.SetToolFrame(2, POSE, "t"), True)),
    (c.SetUserFrame, lambda arm: settings.set_user_frame(arm, c.SetUserFrame(2, POSE, "u"), True)),
    (c.SelectUserFrame, lambda arm: settings.set_user_frame(arm, c.SetUserFrame(2, POSE, "u"), True)),
    (c.SetPayload, lambda arm: settings.set_payload(arm, 0, c.SetPayload(2.5, (0.0, 0.0, 0.0)))),
    (c.SetCollisionLevel, lambda arm: settings.set_collision_level(arm, 2)),
    (c.SetDigitalOutput, lambda arm: settings.set_digital_output(arm, c.SetDigitalOutput(IoBank.CABINET, 2, True))),
    (c.SetAnalogOutput, lambda arm: settings.set_analog_output(arm, c.SetAnalogOutput(IoBank.CABINET, 2, 3.0))),
    (c.SetHandGuiding, lambda arm: settings.set_hand_guiding(arm, True))])
def test_a_setting_that_is_accepted_and_not_kept_is_a_failure(forgets, act):
    arm = simulated()
    settings.set_collision_level(arm, 5)
    with pytest.raises(settings.ReadBackMismatch, match="accepted it but"):
        act(forgetful(arm, forgets))


def test_what_the_controller_refuses_is_told():
    arm = simulated()
    with pytest.raises((CommandRejected, InvalidCommand)):
        settings.set_digital_output(arm, c.SetDigitalOutput(IoBank.CABINET, 9999, True))
    assert arm.core.is_ready(arm.now)


def test_a_controller_that_cannot_read_back_is_named():
    arm = simulated()

    refusal = CommandRejected("get_tool_offsets", 1, "Exception:function call failed")
    silent = Changed(arm, lambda command: refusal if command is c.Query.TOOL_FRAMES else None)
    assert settings.set_tool_frame(silent, c.SetToolFrame(2, POSE, "t"), False) == (
        "tool 2 set" + settings.NOT_VERIFIED)


@pytest.mark.parametrize("field, act", [
    ("current_tool_id", lambda arm: settings.set_tool_frame(arm, c.SetToolFrame(2, POSE, "t"), True)),
    ("current_user_id", lambda arm: settings.set_user_frame(arm, c.SetUserFrame(2, POSE, "u"), True)),
    ("current_tool_id", lambda arm: settings.set_payload(arm, 1, c.SetPayload(1.0, (0.0, 0.0, 0.0))))])
def test_what_the_feed_does_not_tell_is_not_said_to_be_set(field, act):
    arm = simulated()
    arm.show(drop=(field,))
    arm.until(lambda: None in (arm.state.tool_id, arm.state.user_frame_id))
    assert settings.NOT_VERIFIED + "; the active" in act(arm)


def test_hand_guiding_that_the_feed_does_not_tell_is_asked_for_and_excludes_motion():
    arm = simulated()
    arm.show(drop=("drag_status",))
    arm.until(lambda: arm.state.is_hand_guided is None)
    assert settings.set_hand_guiding(arm, True) == "hand guiding on"
    with pytest.raises(InvalidCommand, match="hand guiding owns"):
        raise arm.ended(arm.begin("jog", JOG))
    assert settings.set_hand_guiding(arm, False) == "hand guiding off"


@pytest.mark.parametrize("act", [
    lambda arm: settings.set_tool_frame(arm, c.SetToolFrame(2, POSE, "t"), True),
    lambda arm: settings.set_user_frame(arm, c.SetUserFrame(2, POSE, "u"), True),
    lambda arm: settings.set_payload(arm, 1, c.SetPayload(1.0, (0.0, 0.0, 0.0)))])
def test_frames_and_payload_are_refused_in_mid_motion(act):
    arm = simulated()
    jogged(arm)
    with pytest.raises(InvalidCommand, match="a jog owns"):
        act(arm)
    names = {request["cmdName"] for _, request in arm.sent}
    assert names.isdisjoint({"set_tool_offsets", "set_tool_id", "set_user_offsets", "set_user_id", "set_payload"})


@pytest.mark.parametrize("apart", [0.0, 0.001, 0.004, 0.02, 0.2])
@pytest.mark.parametrize("is_guiding_first", [True, False])
def test_hand_guiding_and_a_move_are_never_both_accepted(is_guiding_first, apart):
    arm = simulated()
    arm.reply_delay = 0.002
    move = c.JointMove((0.3, 1.5, -1.5, 1.5, 1.5, 0.0), 0.5, 4.0)
    calls = [("run", procedures.set_hand_guiding(arm.core, True)), ("move", move, False)]
    first, second = calls if is_guiding_first else calls[::-1]
    begun = [arm.begin(*first, **({"exclusive": MotionOwner.SETTING} if is_guiding_first else {}))]
    arm.run(apart)
    begun.append(arm.begin(*second, **({} if is_guiding_first else {"exclusive": MotionOwner.SETTING})))
    outcomes = [arm.ended(call) is None for call in begun]
    assert outcomes.count(True) == 1, outcomes
    assert arm.ended(arm.begin("stop")) is None
    arm.until(lambda: arm.core.is_free)
    assert outcomes[0] and settings.set_hand_guiding(arm, False) == "hand guiding off"
