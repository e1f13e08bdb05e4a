"""Single checks: states, calls, streams, NaN, further fields, what cannot be compared."""
import numpy as np
import pytest
from synthetic_session import Conditions, Step, moves, simulate, write_log

from jaka_bag.compare.comparison import CannotCompare, compare_logs
from jaka_bag.compare.report.text import as_text
from jaka_bag.compare.tolerances import Tolerances, parse_tolerances
from jaka_bag.compare.verdict import Aspect, Outcome


def session(**changes):
    return simulate(moves(3), Conditions(call_late_s=0.0, stamp_late_s=0.001)._replace(**changes))


def differences(tmp_path, change, tolerances="", base=None):
    golden, candidate = session(), session(seed=4)
    if base is not None:
        base(golden)
        base(candidate)
    change(candidate)
    paths = [write_log(tmp_path / name, one) for name, one in (("golden.mcap", golden), ("candidate.bag", candidate))]
    return compare_logs(paths[0], paths[1], parse_tolerances(tolerances)).differences


def only(found, stage):
    assert [check.aspect for check in found] == [stage], found
    return found[0]


def states(start, end, column, value):
    def change(one):
        one.states[(one.time >= start) & (one.time < end), column] = value
    return change


def test_a_new_state_is_found(tmp_path):
    check = only(differences(tmp_path, states(0.2, 0.6, 3, 1)), Aspect.STATES)
    assert check.field == "collision_state" and "on for 0.4" in check.detail and "is new" in check.detail


def test_a_state_too_brief_to_be_seen_each_time_is_no_difference(tmp_path):
    assert not differences(tmp_path, states(0.3, 0.4, 0, 3))


def test_a_late_change_of_state_is_found(tmp_path):
    def base(one):
        states(0.0, 2.0, 2, 1)(one)
    assert only(differences(tmp_path, states(2.0, 2.7, 2, 1), base=base), Aspect.STATES).field == "servo_state timing"


@pytest.mark.parametrize("column, value", [(0, 4), (0, 2), (1, 0), (3, 1)])
@pytest.mark.parametrize("end", [0.308, 0.4])
def test_a_new_alarm_is_found_however_brief_it_is(column, value, end, tmp_path):
    check = only(differences(tmp_path, states(0.3, end, column, value)), Aspect.STATES)
    assert "is new" in check.detail and check.at == pytest.approx(0.3, abs=0.05)


@pytest.mark.parametrize("column, alarm, none", [(0, 2, 0), (1, 0, 1), (3, 1, 0)])
def test_an_alarm_that_comes_again_is_found_though_what_is_between_is_brief(column, alarm, none, tmp_path):
    def base(one):
        states(0.0, 1.0, column, alarm)(one)

    def change(one):
        states(0.9, 0.91, column, none)(one)
        states(1.1, 1.11, column, alarm)(one)
    assert "comes again" in only(differences(tmp_path, change, base=base), Aspect.STATES).detail


@pytest.mark.parametrize("value", [1, 2, 4, 77])
@pytest.mark.parametrize("rest_s", [0.003, 0.01, 0.09])
def test_another_state_is_found_between_brief_ones(value, rest_s, tmp_path):
    def base(one):
        one.states[:, 0] = np.where(one.time % 0.5 < rest_s, 0, 3)

    def change(one):
        one.states[one.states[:, 0] == 3, 0] = value
    assert only(differences(tmp_path, change, base=base), Aspect.STATES).field == "motion_state"


def drop_call(one):
    del one.calls[1]


def other_request(one):
    one.calls[1] = one.calls[1]._replace(request="pose: [9]")


def other_value(one):
    one.calls[1] = one.calls[1]._replace(response="ret: 1\nvalue: 2.5\nmessage: 'completed'")


def slow_reply(one):
    one.calls[1] = one.calls[1]._replace(duration=one.calls[1].duration + 2.0)


@pytest.mark.parametrize("change, stage, words", [
    (drop_call, Aspect.CALLS, "is missing"), (other_request, Aspect.CALLS, "asks for something else: pose ["),
    (other_value, Aspect.RESPONSES, "answered differently"), (slow_reply, Aspect.DURATIONS, "takes"),
])
def test_calls(tmp_path, change, stage, words):
    assert words in only(differences(tmp_path, change), stage).detail


@pytest.mark.parametrize("joints_from, is_the_call", [(0, False), (400, True)])
def test_a_comparison_tells_the_changed_call_first_unless_something_differs_long_before(
        tmp_path, joints_from, is_the_call):
    def change(one):
        other_request(one)
        one.joints[joints_from:, 0] += 0.1

    golden, candidate = session(), session(seed=4)
    change(candidate)
    paths = [write_log(tmp_path / name, one) for name, one in (("golden.mcap", golden), ("candidate.mcap", candidate))]
    comparison = compare_logs(paths[0], paths[1], Tolerances())
    assert (comparison.beginning.aspect is Aspect.CALLS) is is_the_call
    told = as_text(comparison).splitlines()[-3]
    assert told.startswith("it begins with: %s" % comparison.beginning.name)
    assert told.endswith("%d further differences" % (len(comparison.differences) - 1))


def test_requests_and_responses_may_be_left_out(tmp_path):
    assert not differences(tmp_path, other_request, "calls: {request: ignore}")
    assert not differences(tmp_path, other_value, "calls: {response: ignore}")


def test_a_message_of_other_words_is_no_difference(tmp_path):
    def reword(one):
        one.calls[0] = one.calls[0]._replace(response="ret: 1\nmessage: 'arrived'")
    assert not differences(tmp_path, reword)
    assert only(differences(tmp_path, reword, "calls: {response: exact}"), Aspect.RESPONSES)


def test_a_gap_is_found(tmp_path):
    def gap(one):
        one.keep["robot_states"][(one.time > 0.1) & (one.time < 0.9)] = False
    check = only(differences(tmp_path, gap), Aspect.GAPS)
    assert "the golden log has no such gap" in check.detail and check.at == pytest.approx(0.1, abs=0.05)


def test_the_same_gap_in_both_logs_is_no_difference(tmp_path):
    def gap(one):
        for keep in one.keep.values():
            keep[(one.time > 0.1) & (one.time < 0.9)] = False
    assert not differences(tmp_path, lambda one: None, base=gap)


def test_lost_messages_are_found_by_their_numbers(tmp_path):
    def lose(one):
        one.sequence_step["tool_position"] = 2
    assert only(differences(tmp_path, lose), Aspect.LOST).topic == "/jaka_driver/tool_position"


def test_stamps_that_step_back_are_found(tmp_path):
    def swap(one):
        one.stamp[20], one.stamp[21] = one.stamp[21], one.stamp[20]
    assert {check.field for check in differences(tmp_path, swap)} == {"order"}


def not_a_number(one):
    one.position[100:140, 0] = np.nan


@pytest.mark.parametrize("policy, in_golden, is_same", [
    ("same", False, False), ("same", True, True), ("fail", True, False), ("ignore", False, True)])
def test_nan_policy(tmp_path, policy, in_golden, is_same):
    found = differences(tmp_path, not_a_number, "nan: %s" % policy, base=not_a_number if in_golden else None)
    assert (not found) == is_same
    assert all(check.field == "NaN" for check in found)


def test_a_share_of_the_samples_may_be_outside(tmp_path):
    def bump(one):
        one.joints[100:110, 0] += 0.01
    assert only(differences(tmp_path, bump), Aspect.JOINTS).field == "joint_1"
    assert not differences(tmp_path, bump, "joints: {outside_percent: 2}")
    assert not differences(tmp_path, bump, "joints: {per_joint: {joint_1: 0.02}}")


def test_another_frame_is_found(tmp_path):
    def rename(one):
        one.frame = "user_1"
    assert only(differences(tmp_path, rename), Aspect.POSITION).field == "frame_id"


def test_further_fields_are_compared_where_a_tolerance_names_them(tmp_path):
    def shift(one):
        one.position[:, 1] += 0.0003
    text = "fields: {/jaka_driver/tool_position: {twist.linear.y: {absolute: %s}}}"
    assert not differences(tmp_path, shift, text % "0.001")
    assert only(differences(tmp_path, shift, text % "0.0001"), Aspect.FIELDS).field == "twist.linear.y"


def test_a_topic_that_is_missing_is_found_unless_it_is_optional(tmp_path):
    def mute(one):
        one.keep["robot_states"][:] = False
    assert only(differences(tmp_path, mute), Aspect.TYPES).detail == "not in the candidate"
    assert not differences(tmp_path, mute, "optional_topics: ['.*/robot_states']")
    assert not differences(tmp_path, mute, "ignore_topics: ['.*/robot_states']")


def test_an_arm_that_does_not_move_is_found(tmp_path):
    def stand(one):
        one.joints[:] = one.joints[0]
    stages = {check.aspect for check in differences(tmp_path, stand)}
    assert Aspect.JOINTS in stages and Aspect.PACE not in stages


def test_nothing_in_common_cannot_be_compared(tmp_path):
    one, other = simulate([Step(1.0)]), simulate([Step(1.0)])
    other.node = "/other"
    paths = [write_log(tmp_path / name, s) for name, s in (("a.mcap", one), ("b.mcap", other))]
    with pytest.raises(CannotCompare, match="no topic of the same type in common"):
        compare_logs(*paths)


def test_a_damaged_log_cannot_be_compared(tmp_path):
    path = write_log(tmp_path / "a.mcap", simulate([Step(1.0)]))
    (tmp_path / "b.mcap").write_bytes(path.read_bytes()[:5000])
    with pytest.raises(CannotCompare, match="b.mcap"):
        compare_logs(path, tmp_path / "b.mcap")
    with pytest.raises(CannotCompare, match="cannot read"):
        compare_logs(path, tmp_path / "nothing.mcap")


def test_at_another_time_scale_rates_are_not_compared_and_times_are_scaled(tmp_path):
    golden = write_log(tmp_path / "a.mcap", session())
    fast = session(seed=3)
    for name in fast.log_time:
        fast.log_time[name] = fast.log_time[name] / 4.0
    fast.stamp = fast.stamp / 4.0
    fast.calls = [call._replace(start=call.start / 4.0, duration=call.duration / 4.0) for call in fast.calls]
    comparison = compare_logs(golden, write_log(tmp_path / "b.mcap", fast), Tolerances(), 4.0)
    assert comparison.same, comparison.differences
    assert {check.outcome for check in comparison.checks if check.aspect is Aspect.RATES} == {Outcome.NOT_COMPARED}
