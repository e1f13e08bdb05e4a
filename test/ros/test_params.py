"""Private parameters: a wrong value is refused with name, value and the valid range; the documentation is the
code's."""
import dataclasses
import math

import import_graph
import pytest

from jaka_ros_driver.client.settings import ClientSettings
from jaka_ros_driver.ros import params
from jaka_ros_driver.ros.params import DriverConfig, WrongParameter, config_from

WRONG = [
    ("ip", "", "host name"), ("ip", "10.5.5.256", "host name"), ("ip", "10.5.5", "host name"), ("ip", 10, "host name"),
    ("ip", ("a" * 62 + ".") * 4 + "ab", "host name"),
    ("ip", "10.5.5.100:10001", "host name"), ("ip", "arm one", "host name"), ("ip", "-arm", "host name"),
    ("command_port", 0, "1 to 65535"), ("command_port", 65536, "1 to 65535"), ("command_port", "10001", "1 to 65535"),
    ("command_port", 10001.0, "1 to 65535"), ("command_port", True, "1 to 65535"), ("status_port", -1, "1 to 65535"),
    ("model", "zu77", "zu7"), ("model", 7, "zu7"), ("model", "", "one of"),
    ("dh_file", "no/such/file.yaml", "cannot be read"), ("dh_file", 1, "model file"),
    ("interface", "Documented", "documented, vendor"), ("interface", "", "documented, vendor"),
    ("interface", 1, "documented, vendor"),
    ("blocking", "true", "true or false"), ("blocking", 1, "true or false"), ("auto_enable", "no", "true or false"),
    ("activate_frames", 0, "true or false"), ("guard", None, "true or false"), ("publish_description", 2, "true or"),
    ("publish_rate", 0, "1 to 500 Hz"), ("publish_rate", 501.0, "1 to 500 Hz"), ("publish_rate", "125", "1 to 500 Hz"),
    ("publish_rate", 10 ** 400, "1 to 500 Hz"), ("publish_rate", -10 ** 400, "1 to 500 Hz"),
    ("publish_rate", math.nan, "1 to 500 Hz"), ("stale_after", 0.0, "0.02 to 10 s"),
    ("stale_after", math.inf, "0.02 to 10 s"), ("stale_after", True, "0.02 to 10 s"), ("stale_after", [0.5], "0.02"),
    ("joint_states_topic", "", "ROS name"), ("joint_states_topic", "joint states", "ROS name"),
    ("publish_tf", True, "all, tool, none"), ("publish_tf", "flange", "all, tool, none"),
    ("base_frame", "", "frame name"), ("base_frame", "/base", "frame name"), ("flange_frame", "tool 0", "frame name"),
    ("tool_frame", 3, "frame name"), ("frame_prefix", "1_", "start of a frame name"),
    ("connect_timeout", 0.0, "0.05 to 30 s"), ("reply_timeout", -1.0, "0.05 to 30 s"),
    ("silence_timeout", 0.01, "0.1 to 30 s"), ("motion_timeout", 0, "0.1 to 86400 s"),
    ("power_timeout", 1e9, "0.1 to 300 s"), ("enable_timeout", "30", "0.1 to 300 s"),
    ("jog_timeout", 3.5, "0.05 to 3 s"), ("jog_timeout", 0, "0.05 to 3 s"), ("servo_timeout", -math.inf, "0.05 to"),
    ("servo_ahead", 0.0, "0.008 to 2 s"), ("link_loss_stop", -0.1, "0 to 10 s"), ("link_loss_stop", False, "0 to 10 s"),
    ("stream_ahead", 5, "whole number, 0 to 4"), ("stream_ahead", -1, "0 to 4"), ("stream_ahead", 1.0, "0 to 4"),
    ("stream_ahead", True, "0 to 4"), ("stream_ahead", "2", "0 to 4"),
    ("controller_profile", "/no/such/probe.json", "path of a probe.json"),
    ("controller_profile", 7, "path of a probe.json"),
    ("io_index_base", 2, "auto, 0, 1"), ("io_index_base", True, "auto, 0, 1"), ("io_index_base", "", "auto, 0, 1"),
    ("simulator", "two words", "identity"), ("simulator", 7, "identity"),
    ("servo_max_joint_jump", 0.0, "0.0001 to 6.3 rad"), ("servo_max_linear_jump", 2.5, "0.0001 to 2 m"),
    ("servo_max_angular_jump", math.nan, "0.0001 to 3.2 rad"), ("realtime_priority", 100, "0 to 99"),
    ("jog_max_joint_speed", 1.5, "0.001 to 1 rad/s"), ("jog_max_linear_speed", 0.0, "0.001 to 0.6 m/s"),
    ("jog_max_angular_speed", -0.5, "0.001 to 1 rad/s"),
    ("trajectory_controller", "my controller", "ROS name"), ("industrial_names", "yes", "true or false"),
    ("controller_manager", "no", "auto, true, false"), ("controller_manager", 1, "auto, true, false"),
    ("trajectory_start_tolerance", 0.0, "0.0001 to 1 rad"), ("trajectory_path_tolerance", -0.1, "0 to 1 rad"),
    ("trajectory_goal_tolerance", math.nan, "0 to 1 rad"), ("trajectory_goal_time", 61.0, "0 to 60 s"),
    ("late_stamp", -0.1, "0 to 10 s"), ("late_stamp", "1", "0 to 10 s"),
    ("trajectory_overshoot", "slow", "scale, refuse"), ("trajectory_overshoot", True, "scale, refuse"),
    ("gripper", 1, "keys with values"), ("gripper", {"joint": "finger"}, "stroke_time is missing"),
    ("realtime_priority", -1, "0 to 99"), ("realtime_priority", 50.0, "0 to 99"), ("model", {"name": "zu7"}, "one of"),
    ("audit_dir", "logs", "an absolute path"), ("audit_dir", True, "an absolute path"),
    ("audit_dir", "/logs\0", "an absolute path"), ("audit_days", -1, "0 to 36500 days"),
    ("audit_days", math.inf, "0 to 36500 days"), ("audit_days", "1826", "0 to 36500 days"),
    ("guard_motion", "on", "stop, warn, off"), ("guard_motion", True, "stop, warn, off"),
    ("first_start_only", "yes", "true or false"), ("ip", "::1::", "IP address"), ("ip", "[::1]", "IP address"),
    ("ip", "10.5.5.1:80", "IP address"), ("ip", "fe80::1%", "IP address"), ("ip", "fe80::1%a b", "IP address"),
    ("ip", "m\u00fcnchen", "IP address"), ("ip", "\uff11\uff10.5.5.100", "IP address"),
    ("workspace", 7, "path of a YAML file"), ("workspace", "/no/such/workspace.yaml", "path of a YAML file"),
    ("metrics_port", 65536, "0 to 65535"), ("metrics_port", "9464", "0 to 65535"), ("metrics_port", True, "0 to 65535"),
    ("metrics_address", "localhost", "an IP address"), ("metrics_address", 127, "an IP address"),
]


def test_the_table_is_long_enough_and_touches_every_parameter():
    assert len(WRONG) >= 40
    assert {name for name, _, _ in WRONG} == {name for name, _, _ in params.table()}


@pytest.mark.parametrize("name, value, valid", WRONG, ids=["%s=%r" % row[:2] for row in WRONG])
def test_a_wrong_value_is_refused_with_its_name_and_what_is_valid(name, value, valid):
    with pytest.raises(WrongParameter) as refusal:
        config_from({name: value})
    assert "~" + name in str(refusal.value) and repr(value) in str(refusal.value) and valid in str(refusal.value)


@pytest.mark.parametrize("unknown, nearest", [
    ("robot_ip", "~ip"), ("comand_port", "~command_port"), ("auto_enabled", "~auto_enable"), ("stale", "~stale_after"),
    ("Model", "~model")])
def test_an_unknown_parameter_is_an_error_that_names_the_nearest(unknown, nearest):
    with pytest.raises(WrongParameter, match="unknown parameter ~%s; did you mean %s" % (unknown, nearest)):
        config_from({unknown: 1})


@pytest.mark.parametrize("value, base", [("auto", None), (0, 0), (1, 1), ("0", 0), ("1", 1)])
def test_the_index_base_is_a_number_or_its_text(value, base):
    assert config_from({"io_index_base": value}).client_settings().io_index_base == base
    assert config_from({}).client_settings().io_index_base is None


@pytest.mark.parametrize("given, base, as_counted", [
    ({"interface": "vendor"}, 0, True), ({"interface": "vendor_2025"}, 1, True),
    ({"interface": "vendor_2025", "io_index_base": 0}, 0, True), ({"interface": "vendor", "io_index_base": 1}, 1, True),
    ({"interface": "documented"}, None, False), ({"io_index_base": 1}, 1, False)])
def test_the_index_base_is_that_of_the_makers_drivers_on_every_firmware(given, base, as_counted):
    settings = config_from(given).client_settings()
    assert (settings.io_index_base, settings.takes_io_as_counted) == (base, as_counted)
    assert config_from(given).asks_for_terminals is (as_counted and base == 1)


@pytest.mark.parametrize("own, name, common, ip, said", [
    ({}, "/ip", "10.5.5.100", "10.5.5.100", "/ip names, 10.5.5.100"),
    ({}, "/left/ip", "arm-2.cell", "arm-2.cell", "/left/ip names"),
    ({"ip": "127.0.0.1", "simulator": "sim_1"}, "/ip", "10.5.5.100", "127.0.0.1", "not used: ~ip is '127.0.0.1'"),
    ({"simulator": "sim_1"}, "/ip", "10.5.5.100", "127.0.0.1", "not used"),
    ({"ip": "10.5.5.101"}, "/ip", {"of": "a camera"}, "10.5.5.101", "not used"),
    ({"ip": "10.5.5.100"}, "/ip", "10.5.5.100", "10.5.5.100", None), ({}, "", None, "127.0.0.1", None)])
def test_the_makers_address_is_taken_where_there_is_none_of_its_own_and_that_is_said(own, name, common, ip, said):
    values, notice = params.with_common_ip(own, name, common)
    assert config_from(values).ip == ip
    assert (notice == "") if said is None else said in notice


@pytest.mark.parametrize("common", [{"of": "a camera"}, 7, "", "10.5.5", "the arm", ["10.5.5.1"], True, "10.5.5.1:80"])
def test_a_common_ip_that_is_no_address_is_refused_and_not_passed_over(common):
    with pytest.raises(WrongParameter, match="~ip is not set, and /ip is .*valid: host name or IP address.*set ~ip"):
        params.with_common_ip({}, "/ip", common)


def test_all_mistakes_are_told_at_once():
    with pytest.raises(WrongParameter) as refusal:
        config_from({"blocking": "yes", "modle": "zu7", "status_port": 0})
    assert all(name in str(refusal.value) for name in ("~blocking", "~modle", "~status_port"))


def test_one_port_for_both_is_refused():
    with pytest.raises(WrongParameter, match="must differ"):
        config_from({"command_port": 10000})


def test_defaults_and_values_reach_the_client():
    assert config_from({}).client_settings() == ClientSettings("127.0.0.1")
    given = {"ip": "10.5.5.100", "publish_rate": 200, "jog_timeout": 1, "servo_max_joint_jump": 0.2, "stale_after": 0.3}
    settings = config_from(given).client_settings()
    assert settings == ClientSettings("10.5.5.100", feed_period=0.005, jog_timeout=1.0, servo_max_joint_jump=0.2,
                                      stale_after=0.3)


def test_the_zones_of_a_file_reach_the_client(tmp_path):
    file = tmp_path / "cell.yaml"
    file.write_text("floor: -0.01\n")
    settings = config_from({"workspace": str(file), "guard_motion": "warn"}).client_settings()
    assert settings.workspace.floor == -0.01 and settings.guard_motion == "warn"


def test_a_low_rate_of_the_topics_does_not_slow_down_what_custody_sees():
    assert config_from({"publish_rate": 1}).client_settings().feed_period == 0.008


def test_every_setting_of_the_client_is_a_parameter():
    settings = {field.name for field in dataclasses.fields(ClientSettings)} - {
        "host", "feed_period", "takes_io_as_counted", "start_delay"}  # the last is the profile's
    assert settings <= {field.name for field in dataclasses.fields(DriverConfig)}


def test_the_model_is_known_by_its_names_and_a_file_replaces_it(tmp_path):
    assert config_from({"model": "JAKA Zu 12"}).arm_model().name == "zu12"
    file = tmp_path / "mine.yaml"
    file.write_text("""
family: three_parallel_offset_wrist
dh_standard:
- {a: 0, d: 120.15, alpha: 1.5707963267948966}
- {a: 360, d: 0, alpha: 0}
- {a: 303.5, d: 0, alpha: 0}
- {a: 0, d: -115.01, alpha: 1.5707963267948966}
- {a: 0, d: 113.5, alpha: -1.5707963267948966}
- {a: 0, d: 107, alpha: 0}
joint_limits_deg: [[-360, 360], [-85, 265], [-175, 175], [-85, 265], [-360, 360], [-360, 360]]
joint_max_speed_deg_s: [180, 180, 180, 180, 180, 180]
""")
    assert config_from({"dh_file": str(file)}).arm_model().name == "mine"


def test_frames_are_activated_as_the_interface_says_unless_told_otherwise():
    assert config_from({}).activates_frames
    assert not config_from({"interface": "vendor"}).activates_frames
    assert config_from({"interface": "vendor", "activate_frames": True}).activates_frames
    newest = config_from({"interface": "vendor_2025"})
    assert newest.is_vendor and newest.is_vendor_2025 and not newest.activates_frames
    assert not config_from({"interface": "vendor"}).is_vendor_2025
    assert not config_from({"activate_frames": False}).activates_frames


def test_the_documentation_is_what_the_code_says():
    written = (import_graph.ROOT / "docs" / "parameters.md").read_text(encoding="utf-8")
    assert written == params.markdown(), "run build/venv/bin/python3 -m jaka_ros_driver.ros.params > docs/parameters.md"


@pytest.mark.parametrize("written, taken", [
    ("::1", "::1"), ("2001:DB8:0::0001", "2001:db8::1"), ("fe80::1%eth0", "fe80::1%eth0"),
    ("::ffff:10.5.5.100", "10.5.5.100"), ("arm-1.cell.local", "arm-1.cell.local")])
def test_ipv6_addresses_and_names_are_taken(written, taken):
    assert config_from({"ip": written}).ip == taken


def test_the_longest_host_name_is_taken():
    # A host name has up to 253 characters (RFC 1035).
    assert len(config_from({"ip": ("a" * 62 + ".") * 4 + "a"}).ip) == 253
