"""The scenario beside a golden log, and the facts of the log itself."""
import pytest
from synthetic_session import Step, simulate, write_log

from jaka_bag.compare.tolerances import ToleranceError
from jaka_regression.scenario import (
    BEGIN,
    DEFAULT_SIMULATION,
    ArmSetup,
    CauseKind,
    EventCause,
    ScenarioError,
    parse_scenario,
    scenario_of,
)


def test_without_a_file_the_log_tells_its_arms(tmp_path):
    left, right = (simulate([Step(1.0)]) for _ in range(2))
    left.node, right.node = "/left/jaka_driver", "/right/jaka_driver"
    log = write_log(tmp_path / "two.mcap", left, right)
    assert [arm.namespace for arm in scenario_of(log).arms] == ["/left", "/right"]


def test_recorded_parameters_go_to_the_driver_but_not_its_address(tmp_path):
    from jaka_bag.containers.mcap.writer import McapWriter
    from jaka_bag.messages.connection import Connection
    path = tmp_path / "log.mcap"
    with McapWriter(path) as writer:
        channel = writer.add_channel(Connection("/left/jaka_driver/joint_position", "sensor_msgs/JointState"))
        writer.add_message(channel, 1, b"")
        writer.add_attachment("rosparam.yaml", b"left: {jaka_driver: {ip: 10.0.0.2, model: zu5, blocking: false}}")
    assert scenario_of(path).arms == (ArmSetup("/left", "zu5", DEFAULT_SIMULATION, (("blocking", False),)),)


def test_a_file_beside_the_log_says_it_all(tmp_path):
    log = write_log(tmp_path / "one.mcap", simulate([Step(1.0)]))
    (tmp_path / "one.yaml").write_text("""
about: made by hand
arms: [{namespace: /left, model: zu12, simulation: [--start, "off"], parameters: {auto_enable: true}}]
events: [{after_call: 2, delay_s: 0.5, action: hit, force: 300}]
tolerances: {joints: {position_rad: 0.01}}
""")
    scenario = scenario_of(log)
    assert scenario.arms[0] == ArmSetup("/left", "zu12", ("--start", "off"), (("auto_enable", True),))
    assert scenario.events[0].arm == "/left" and scenario.events[0].after == EventCause(CauseKind.CALL, "", (), 2)
    assert scenario.has_events
    assert scenario.events[0].request == {"action": "hit", "force": 300}
    assert scenario.tolerances.joints.position_rad == 0.01


@pytest.mark.parametrize("text, words", [
    ("arms: {}", "expected a list"), ("arm: []", "did you mean 'arms'"), ("arms: []", "at least one"),
    ("arms: [{namespace: left}]", "does not begin with /"), ("arms: [{}, {}]", "namespace of its own"),
    ("arms: [{modell: zu7}]", "did you mean 'model'"), ("events: [{after_call: 1}]", "action among them"),
    ("events: [{action: hit, arm: /right}]", "no arm '/right'"), ("events: [{action: hit, after_call: one}]", "number"),
    ("events: [{action: hit, delay_s: -1}]", "negative"), ("about: [1]", "a text"), ("a: b: c", "mapping values"),
    ("about: 2001-99-99", "golden.yaml"),
    ("arms: [{simulation: --start off}]", "a list"), ("arms: [{simulation: [--start, off]}]", "put them in quotes"),
])
def test_what_is_not_understood_is_refused_with_the_key(text, words):
    with pytest.raises(ScenarioError, match=words):
        parse_scenario(text, "golden.yaml")


@pytest.mark.parametrize("cause, after", [
    ("", BEGIN), ("after_call: null, ", BEGIN),
    ("after_call: 3, ", EventCause(CauseKind.CALL, "", (), 3)),
    ("after_motion: 1, ", EventCause(CauseKind.MOTION, "/left", (), 1)),
    ("after_answer: {service: linear_move, nth: 2}, ", EventCause(CauseKind.ANSWER, "/left", ("linear_move",), 2)),
    ("after_output: {index: 2}, ", EventCause(CauseKind.OUTPUT, "/left", ("cabinet", 2, 1), 0)),
    ("after_output: {bank: tool, index: 0, value: 0, nth: 1}, ",
     EventCause(CauseKind.OUTPUT, "/left", ("tool", 0, 0), 1)),
    ("after_input: {index: 5, value: true}, ", EventCause(CauseKind.INPUT, "/left", ("cabinet", 5, 1), 0)),
])
def test_an_event_comes_after_its_cause(cause, after):
    text = "arms: [{namespace: /left}]\nevents: [{%sdelay_s: 0.4, action: set_input, index: 3, value: 1}]" % cause
    (event,) = parse_scenario(text, "golden.yaml").events
    assert event.after == after and event.delay_s == 0.4
    assert event.request == {"action": "set_input", "index": 3, "value": 1}


@pytest.mark.parametrize("cause, words", [
    ("after_call: 1, after_motion: 1", "not several"), ("after_motion: -1", "negative"), ("after_motion: x", "motion"),
    ("after_answer: linear_move", "keys with values"), ("after_answer: {nth: 1}", "a service below the driver"),
    ("after_output: {value: 1}", "number of a terminal"), ("after_output: {index: 1, value: 2}", "0 or 1, not 2"),
    ("after_output: {index: 1, bank: cabinett}", "cabinet, tool, extension"), ("after_input: {index: -1}", "negative"),
    ("after_input: {indx: 1}", "did you mean 'index'"), ("after_ouput: {index: 1}", "did you mean 'after_output'"),
])
def test_a_cause_that_is_not_understood_is_refused_with_the_key(cause, words):
    with pytest.raises(ScenarioError, match=words):
        parse_scenario("events: [{%s, action: hit}]" % cause, "golden.yaml")


def test_a_file_with_no_more_than_tolerances_leaves_the_arms_to_the_log(tmp_path):
    left = simulate([Step(1.0)])
    left.node = "/left/jaka_driver"
    log = write_log(tmp_path / "one.mcap", left)
    (tmp_path / "one.yaml").write_text("tolerances: {joints: {position_rad: 0.01}}\n")
    scenario = scenario_of(log)
    assert [arm.namespace for arm in scenario.arms] == ["/left"] and not scenario.has_events


def test_wrong_tolerances_are_refused_as_such():
    with pytest.raises(ToleranceError, match="golden.yaml: tolerances"):
        parse_scenario("tolerances: {joints: {position: 1}}", "golden.yaml")
