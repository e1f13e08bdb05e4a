"""A report of jaka_probe as parameter of the driver: what it sets, what is refused with which reason."""
import json

import pytest

from jaka_ros_driver.ros.controller_profile import ControllerProfile, knowledge, profile_from
from jaka_ros_driver.ros.exit_codes import CONFIGURATION, exit_code_of
from jaka_ros_driver.ros.params import WrongParameter, config_from


@pytest.fixture
def report(tmp_path):
    def write(**facts):
        path = tmp_path / "probe.json"
        rows = {name: {"value": value, "how": ""} for name, value in facts.items()}
        path.write_text(json.dumps({"format": 1, "facts": rows}))
        return str(path)
    return write


@pytest.mark.parametrize("values, base", [
    ({}, 1), ({"io_index_base": 0}, 0), ({"interface": "vendor"}, 0), ({"interface": "vendor_2025"}, 1)])
def test_it_sets_the_first_terminal_where_nothing_else_does(report, values, base):
    config = config_from({**values, "controller_profile": report(io_index_base=1, version="1.5.14")})
    assert config.client_settings().io_index_base == base
    assert config_from({"controller_profile": report(io_index_base=None)}).client_settings().io_index_base is None
    assert config_from({"controller_profile": ""}).controller_profile is None


@pytest.mark.parametrize("facts, reason", [
    ({"io_index_base": 2}, "fact io_index_base is 2; valid: 0 or 1"),
    ({"io_index_base": True}, "fact io_index_base is True"),
    ({"stop_ends_jog": "yes"}, "valid: true or false"), ({"jog_stop_ends": ["any"]}, "valid: any or its axis"),
    ({"feed_period": float("nan")}, "valid: 0.0005 to 60 s"), ({"feed_period": 60.1}, "valid: 0.0005 to 60 s"),
    ({"feed_period": 0.0004}, "valid: 0.0005 to 60 s"), ({"feed_period": 10 ** 400}, "valid: 0.0005 to 60 s"),
    ({"io_index_base": 10 ** 400}, "valid: 0 or 1"), ({"commands_missing": "all"}, "valid: a list of names"),
    ({"start_delay": -0.1}, "valid: 0 to 30 s"), ({"start_delay": 30.1}, "valid: 0 to 30 s"),
    ({"start_delay": True}, "valid: 0 to 30 s"), ({"start_delay": float("nan")}, "valid: 0 to 30 s"),
    ({"version": 17}, "valid: a text")])
def test_a_fact_that_is_none_is_refused_with_its_name(report, facts, reason):
    with pytest.raises(WrongParameter) as told:
        config_from({"controller_profile": report(**facts)})
    assert reason in str(told.value) and "parameter ~controller_profile" in str(told.value)
    assert exit_code_of(told.value) == CONFIGURATION == 2


@pytest.mark.parametrize("seen, taken", [(4.2, 4.2), (0, 0.0), (None, 0.0)])
def test_an_arm_that_was_seen_to_begin_late_has_that_long(report, seen, taken):
    assert config_from({"controller_profile": report(start_delay=seen)}).client_settings().start_delay == taken
    assert config_from({}).client_settings().start_delay == 0.0


@pytest.mark.parametrize("text, reason", [
    ("", "Expecting value"), ("[]", "no probe.json"), ('{"format": 2, "facts": {}}', "no probe.json"),
    ('{"format": 1, "facts": 3}', "no probe.json"), ("[" * 5000, ""), (" " * (1 << 21), "no probe.json")])
def test_a_file_that_is_no_report_is_refused(tmp_path, text, reason):
    path = tmp_path / "probe.json"
    path.write_text(text)
    with pytest.raises(WrongParameter) as told:
        config_from({"controller_profile": str(path)})
    assert reason in str(told.value)
    for wrong in (str(tmp_path / "none.json"), 7, str(tmp_path)):
        with pytest.raises(WrongParameter):
            config_from({"controller_profile": wrong})


@pytest.mark.parametrize("stops, told", [
    (True, "seen on this controller, of a closed connection: the controller stops the arm 0.3 s after"),
    (False, "seen on this controller: it does not stop the arm"),
    (None, "assumed: the controller stops the arm 0.3 s")])
def test_whether_a_lost_client_stops_the_arm_is_told(report, stops, told):
    profile = profile_from(report(link_loss_stops=stops))
    assert dict(knowledge(profile, 0, False, 0.3, None))["loss of the link"].startswith(told)
    with pytest.raises(ValueError, match="link_loss_stops is 1; valid: true or false"):
        profile_from(report(link_loss_stops=1))


def test_what_is_known_and_what_is_assumed_is_told():
    assumed = dict(knowledge(None, 1, False, 0.3, None))
    assert assumed["first terminal"] == "1, assumed, by its version"
    assert all("assumed" in words for words in assumed.values()) and len(assumed) == 5
    profile = ControllerProfile("probe.json", "1.7.2", 0, False, "its axis", 0.03, 0.2,
                                ("set_network_exception_handle",))
    known = dict(knowledge(profile, 0, False, 0.3, 0.008))
    assert not any("assumed" in words for words in known.values())
    assert known["first terminal"] == "0, seen on this controller" and "30 ms" in known["period of the feed"]
    assert known["begin of a motion"].startswith("0.2 s after its acceptance, seen on this controller")
    assert "stop_program does not end it" in known["stop of a jog"] and "its axis" in known["stop of a jog"]
    assert dict(knowledge(profile, 1, True, 0.0, 0.008))["first terminal"] == "1, set"
    assert dict(knowledge(profile, 1, True, 0.0, 0.008))["loss of the link"] == "not asked for"


def test_a_report_of_the_program_is_taken(tmp_path):
    from jaka_ros_driver.probe.facts import Fact, ProbeStage
    from jaka_ros_driver.probe.report import as_json
    facts = {"version": Fact("1.7.2_16", ""), "io_index_base": Fact(1, ""), "stop_ends_jog": Fact(None, ""),
             "commands_missing": Fact(["get_motion_state"], ""), "feed_period": Fact(0.03, "")}
    path = tmp_path / "probe.json"
    path.write_text(json.dumps(as_json(facts, list(ProbeStage), True)))
    assert profile_from(str(path)) == ControllerProfile(str(path), "1.7.2_16", 1, feed_period=0.03,
                                                        missing_commands=("get_motion_state",))
