"""The commands, each once as it should be, and tables of wrong ones; over real sockets."""
import json
import math

import pytest
from good_requests import BEFORE, GOOD, HOME, HOME_POSE, NEAR, NEAR_POSE, TESTED_APART, ZEROS
from raw_client import RawClient, poll
from waiting import wait_until

from jaka_ros_driver.simulation.controller.command_table import COMMANDS
from jaka_ros_driver.simulation.controller.status_frame import all_field_names

OFF = {"power_off", "shutdown"}


def test_every_command_stands_in_the_table():
    assert set(GOOD) | TESTED_APART == set(COMMANDS)
    assert not set(GOOD) & TESTED_APART


@pytest.mark.parametrize("command", GOOD)
def test_good(command, make_arm):
    parameters, fields = GOOD[command]
    with RawClient(make_arm(start="off" if command in OFF else "enabled").command_port) as client:
        for before, its_parameters in BEFORE.get(command, []):
            assert client.code(before, **its_parameters) == "0"
        reply = client.ask(command, **dict(parameters, a_key_nobody_knows=[1, {"x": None}]))
    assert reply == {**fields, "errorCode": "0", "errorMsg": "", "cmdName": command}


def test_data_is_the_whole_frame_with_the_length_of_the_reply(make_arm):
    arm = make_arm()
    with RawClient(arm.command_port) as client:
        client.send(b'{"cmdName":"get_data"}')
        raw = b""
        while not raw.endswith(b'"cmdName": "get_data"}'):
            raw += client.socket.recv(65536)
        assert raw.startswith(b'{"len": %d, ' % len(raw))
        reply = client.ask("get_data")
    assert list(reply)[1:-3] == list(all_field_names(arm.server.controller.state.firmware))[:34]
    assert reply["errorCode"] == "0" and reply["joint_actual_position"] == HOME


def test_identity_is_the_one_that_it_was_given(make_arm):
    with RawClient(make_arm(identity="sim_host_12_3").command_port) as client:
        assert client.ask("get_simulator_identity") == {
            "identity": "sim_host_12_3", "errorCode": "0", "errorMsg": "", "cmdName": "get_simulator_identity"}


@pytest.mark.parametrize("firmware", ["1.5.14", "1.7.1", "1.7.2"])
def test_emergency_stop_status(make_arm, firmware):
    arm = make_arm(firmware=firmware)
    with RawClient(arm.command_port) as client:
        assert client.ask("emergency_stop_status")["emergency_stop"] == 0
        arm.operate("press_emergency_stop")
        assert client.ask("emergency_stop_status")["emergency_stop"] == 1


def test_robot_state_of_the_modern_firmware(make_arm):
    with RawClient(make_arm(firmware="1.7", start="powered").command_port) as client:
        assert client.ask("get_robot_state") == {
            "enable": False, "power": 1, "errcode": 0, "msg": "", "errorCode": "0", "errorMsg": "",
            "cmdName": "get_robot_state"}


def test_replies_are_written_as_python_writes_json(client):
    client.send(b'{"cmdName":"get_payload"}')
    data = b""
    while not data.endswith(b"}"):
        data += client.socket.recv(65536)
    assert data == (b'{"mass": 0.0, "centroid": [0.0, 0.0, 0.0], "errorCode": "0", "errorMsg": "", '
                    b'"cmdName": "get_payload"}')


NOT_UNDERSTOOD = {"errorCode": "1", "errorMsg": "Exception:function call failed"}
WRONG_TYPES = [
    {}, {"cmdName": None}, {"cmdName": 5}, {"cmdName": ["power_on"]}, {"cmdName": "no_such_command"},
    {"cmdName": "Power_on"}, {"cmdName": "movl"}, {"cmdName": "linear_move"}, {"cmdName": "motion_abort"},
    {"cmdName": "joint_move"},
    {"cmdName": "joint_move", "jointPosition": NEAR},
    {"cmdName": "joint_move", "jointPosition": NEAR, "speed": "fast"},
    {"cmdName": "joint_move", "jointPosition": NEAR, "speed": None},
    {"cmdName": "joint_move", "jointPosition": "home", "speed": 10},
    {"cmdName": "joint_move", "jointPosition": {"a": 1}, "speed": 10},
    {"cmdName": "joint_move", "jointPosition": [0, 90, -90, "90", 90, 0], "speed": 10},
    {"cmdName": "joint_move", "jointPosition": [0, 90, -90, None, 90, 0], "speed": 10},
    {"cmdName": "joint_move", "jointPosition": [0, 90, -90, [90], 90, 0], "speed": 10},
    {"cmdName": "joint_move", "jointPosition": NEAR, "speed": 10, "relFlag": 2},
    {"cmdName": "joint_move", "jointPosition": NEAR, "speed": 10, "accel": "x"},
    {"cmdName": "joint_move", "jointPosition": NEAR, "speed": 10, "executing_line_id": 1.5},
    {"cmdName": "moveL", "jointPosition": NEAR, "speed": 10},
    {"cmdName": "end_move", "end_position": NEAR_POSE, "speed": 10},
    {"cmdName": "jog"}, {"cmdName": "jog", "jog_mode": 1, "coord_map": 1, "jnum": 0},
    {"cmdName": "jog", "jog_mode": "1", "coord_map": 1, "jnum": 0, "jogvel": 5},
    {"cmdName": "jog", "jog_mode": 2, "coord_map": 1, "jnum": 0, "jogvel": 5},
    {"cmdName": "servo_move"}, {"cmdName": "servo_move", "relFlag": "on"}, {"cmdName": "servo_move", "relFlag": 2},
    {"cmdName": "set_servo_move_filter"}, {"cmdName": "set_servo_move_filter", "filter_type": 1},
    {"cmdName": "set_tool_offsets", "id": 1}, {"cmdName": "set_tool_offsets", "tooloffset": ZEROS},
    {"cmdName": "set_tool_offsets", "tooloffset": ZEROS, "id": "2"},
    {"cmdName": "set_tool_offsets", "tooloffset": ZEROS, "id": 2, "name": 5},
    {"cmdName": "set_tool_offsets", "tooloffset": ZEROS, "id": 2, "name": "x" * 1000},
    {"cmdName": "set_user_offsets", "id": 2}, {"cmdName": "set_tool_id"}, {"cmdName": "set_user_id", "id": 1},
    {"cmdName": "set_payload", "mass": 1.0}, {"cmdName": "set_payload", "mass": "1", "centroid": [0, 0, 0]},
    {"cmdName": "set_clsn_sensitivity"}, {"cmdName": "set_clsn_sensitivity", "sensitivityVal": 2.5},
    {"cmdName": "rapid_rate"}, {"cmdName": "rapid_rate", "rate_value": "0.5"},
    {"cmdName": "set_digital_output", "type": 0, "index": 1}, {"cmdName": "set_digital_output", "type": 0, "value": 1},
    {"cmdName": "set_digital_output", "type": 0, "index": 1, "value": 2},
    {"cmdName": "set_analog_output", "type": 0, "index": 1, "value": [[1]]},
    {"cmdName": "get_digital_input"}, {"cmdName": "kine_forward"}, {"cmdName": "kine_inverse", "jointPosition": HOME},
    {"cmdName": "torque_control_enable"}, {"cmdName": "torque_control_enable", "enable_flag": 5},
    {"cmdName": "load_program"}, {"cmdName": "set_port10000_delay_ms"},
    {"cmdName": "set_port10000_delay_ms", "port10000_delay_ms": "x"},
    {"cmdName": "setOptionalInfoConfig", "section": "PORTCONFIG", "key": "port10000_delay_ms", "value": "soon"},
    {"cmdName": "set_installation_angle", "angleX": 1}, {"cmdName": "set_torque_sensor_soft_limit"},
    {"cmdName": "modify_user_defined_variable", "id_new": 1, "value_new": {"a": 1}},
]
REFUSED = [
    ("modify_user_defined_variable", {"id_new": 1, "value_new": 1e300}),
    ("joint_move", {"jointPosition": [500.0, 90, -90, 90, 90, 0], "speed": 10}),
    ("joint_move", {"jointPosition": [0, 90, -90], "speed": 10}),
    ("joint_move", {"jointPosition": NEAR + [0.0, 0.0, 0.0], "speed": 10}),
    ("joint_move", {"jointPosition": [], "speed": 10}),
    ("joint_move", {"jointPosition": NEAR, "speed": 0}),
    ("joint_move", {"jointPosition": NEAR, "speed": -10}),
    ("joint_move", {"jointPosition": NEAR, "speed": 10, "accel": -5}),
    ("joint_move", {"jointPosition": [1e300] * 6, "speed": 10}),
    ("joint_move", {"jointPosition": [5, 0, 0, 0, 0, 1e9], "speed": 10, "relFlag": 1}),
    ("end_move", {"endPosition": [5000.0, 0, 0, 180, 0, 0], "speed": 10}),
    ("end_move", {"endPosition": [1.0, 2.0], "speed": 10}),
    ("moveL", {"cartPosition": [5000.0, 0, 0, 180, 0, 0], "speed": 10}),
    ("moveL", {"cartPosition": [1e200, 0, 0, 180, 0, 0], "speed": 10}),
    ("moveL", {"cartPosition": NEAR_POSE, "speed": 0}),
    ("moveL", {"cartPosition": NEAR_POSE, "speed": 10, "ori_vel": -1.0}),
    ("movc", {"pos_mid": HOME_POSE, "pos_end": [9000.0, 0, 0, 0, 0, 0], "speed": 10}),
    ("jog", {"jog_mode": 7, "coord_map": 1, "jnum": 0, "jogvel": 5}),
    ("jog", {"jog_mode": 1, "coord_map": 9, "jnum": 0, "jogvel": 5}),
    ("jog", {"jog_mode": 1, "coord_map": 1, "jnum": 6, "jogvel": 5}),
    ("jog", {"jog_mode": 1, "coord_map": 1, "jnum": -1, "jogvel": 5}),
    ("jog", {"jog_mode": 3, "coord_map": 1, "jnum": 1, "jogvel": 5, "poscmd": 900}),
    ("set_servo_move_filter", {"filter_type": 9}), ("set_servo_move_filter", {"filter_type": 1, "lpf_cf": -1}),
    ("set_tool_offsets", {"tooloffset": ZEROS, "id": 0, "name": "flange"}),
    ("set_tool_offsets", {"tooloffset": ZEROS, "id": 16, "name": "x"}),
    ("set_tool_offsets", {"tooloffset": [1, 2, 3], "id": 1, "name": "x"}),
    ("set_user_offsets", {"useroffset": ZEROS, "id": -1, "name": "x"}),
    ("set_tool_id", {"tool_id": 16}), ("set_user_id", {"user_frame_id": -2}),
    ("set_payload", {"mass": -1.0, "centroid": [0, 0, 0]}), ("set_payload", {"mass": 1.0, "centroid": [0, 0]}),
    ("set_clsn_sensitivity", {"sensitivityVal": 6}), ("set_clsn_sensitivity", {"sensitivityVal": -1}),
    ("rapid_rate", {"rate_value": 1.5}), ("rapid_rate", {"rate_value": -0.1}),
    ("set_digital_output", {"type": 0, "index": 135, "value": 1}),
    ("set_digital_output", {"type": 9, "index": 0, "value": 1}),
    ("set_digital_output", {"type": 0, "index": -1, "value": 1}),
    ("set_analog_output", {"type": 3, "index": 0, "value": 1.0}),
    ("set_analog_output", {"type": 0, "index": 0, "value": 1e9}),
    ("get_digital_input", {"type": 3, "index": 0}), ("get_analog_input", {"type": 0, "index": 64}),
    ("load_program", {"programName": ""}), ("load_program", {"programName": "no_such"}),
    ("play_program", {}), ("set_motion_planner", {"type": 4}),
    ("set_port10000_delay_ms", {"port10000_delay_ms": 0}), ("set_port10000_delay_ms", {"port10000_delay_ms": 10 ** 9}),
    ("setOptionalInfoConfig", {"section": "X", "key": "y", "value": 1}),
    ("setOptionalInfoConfig", {"section": "ATTROPTIONALDATA", "key": "len", "value": 0}),
    ("getOptionalInfoConfig", {"section": "X", "key": "y"}),
    ("set_installation_angle", {"angleX": 181, "angleZ": 0}), ("set_installation_angle", {"angleX": 0, "angleZ": 360}),
    ("set_network_exception_handle", {"motType": 5, "timeLimit": 1}), ("shutdown", {}), ("power_off", {}),
    ("set_torsenosr_brand", {"sensor_brand": 4}), ("set_tio_pin_mode", {"pinType": 99, "pinMode": 0}),
    ("set_admit_ctrl_config", {"axis": 6}), ("del_tio_rs_signal", {"tio_signal_name": "unknown"}),
]


def test_what_is_not_understood_is_answered_1_and_moves_nothing(arm, client):
    for request in WRONG_TYPES:
        client.send(json.dumps(request).encode())
        assert client.reply() == NOT_UNDERSTOOD, request
    assert client.ask("get_joint_pos")["joint_pos"] == HOME
    assert client.ask("get_motion_state")["queue"] == 0


def test_what_is_refused_is_answered_2_and_does_not_latch(arm, client, feed):
    for command, parameters in REFUSED:
        assert client.ask(command, **parameters) == {
            "errorCode": "2", "errorMsg": "call %s failed" % command, "cmdName": command}, parameters
    assert client.ask("get_joint_pos")["joint_pos"] == HOME
    assert feed.frame()["errcode"] == "0x0"
    assert client.code("joint_move", jointPosition=NEAR, speed=20) == "0"
    assert client.ask("wait_complete")["errorCode"] == "0"
    assert client.ask("get_joint_pos")["joint_pos"] == NEAR


def test_inverse_kinematics_that_fails_has_a_code_of_its_own(client):
    reply = client.ask("kine_inverse", jointPosition=HOME, cartPosition=[5000.0, 0.0, 0.0, 180.0, 0.0, 0.0])
    assert reply == {"errorCode": "-4", "errorMsg": "inverse kinematics failed", "cmdName": "kine_inverse"}


@pytest.mark.parametrize("text", [b"1e999", b"-1e999", b"1" + b"0" * 400, b"123456789012345678901234567890"])
def test_huge_numbers_are_refused(client, text):
    client.send(b'{"cmdName":"joint_move","jointPosition":[%s,90,-90,90,90,0],"speed":10}' % text)
    assert client.reply()["errorCode"] in ("1", "2")
    assert client.ask("get_joint_pos")["joint_pos"] == HOME


def test_defaults_of_missing_keys(client):
    assert client.code("joint_move", jointPosition=NEAR, speed=90) == "0"  # no relFlag, no accel, no tol
    assert client.code("moveL", cartPosition=NEAR_POSE, speed=100) == "0"
    assert client.code("end_move", endPosition=HOME_POSE, speed=90) == "0"
    assert client.code("wait_complete") == "0"
    for wanted, is_there in zip(HOME, client.ask("get_joint_pos")["joint_pos"]):
        assert math.isclose(wanted, is_there, abs_tol=1e-4)
    assert client.code("servo_move", relFlag=1) == "0"
    assert client.code("servo_j", jointPosition=HOME) == "0"  # no stepNum
    assert client.code("servo_j", jointPosition=ZEROS, relFlag=1) == "0"
    assert client.code("servo_move", relFlag=0) == "0"


@pytest.mark.parametrize("key", ["userffset", "useroffset"])
def test_both_spellings_of_the_user_frame(client, key):
    frame = [200.0, -10.5, 3.25, 10.0, 20.0, 90.0]
    assert client.code("set_user_offsets", **{key: frame, "id": 3, "name": "table"}) == "0"
    assert client.ask("get_user_offsets")["user_offsets"][3] == frame


def test_frames_are_stored_then_activated_a_little_later(client, feed):
    assert client.code("set_tool_offsets", tooloffset=[0.0, 0.0, 100.0, 0.0, 0.0, 0.0], id=2, name="gripper") == "0"
    assert client.ask("get_tcp_pos")["tcp_pos"] == HOME_POSE
    assert client.code("set_tool_id", tool_id=2) == "0"
    frames = feed.until(lambda frame: frame["current_tool_id"] == 2)
    assert frames[-1]["actual_position"] == [417.0, 115.01, 273.15, 180.0, 0.0, -90.0]
    assert client.ask("get_curr_tool_id")["id"] == 2
    assert client.code("set_user_offsets", userffset=[100.0, 0.0, 0.0, 0.0, 0.0, 0.0], id=1, name="table") == "0"
    assert client.code("set_user_id", user_frame_id=1) == "0"
    feed.until(lambda frame: frame["current_user_id"] == 1)
    assert client.ask("get_tcp_pos")["tcp_pos"][:3] == [317.0, 115.01, 273.15]
    assert client.ask("kine_forward", jointPosition=HOME)["cartPosition"][:3] == [317.0, 115.01, 273.15]
    assert client.code("set_tool_offsets", tooloffset=ZEROS, id=2, name="none") == "0"  # the active one, at once
    assert client.ask("get_tcp_pos")["tcp_pos"][:3] == [317.0, 115.01, 373.15]


def test_tool_is_not_changed_in_motion(client):
    assert client.code("set_tool_offsets", tooloffset=NEAR, id=2, name="x") == "0"
    assert client.code("joint_move", jointPosition=[170.0, 90, -90, 90, 90, 0], speed=20) == "0"
    assert client.code("set_tool_id", tool_id=2) == "2"
    assert client.code("set_tool_id", tool_id=0) == "0"  # the active one
    assert client.code("stop_program") == "0"


def test_what_is_set_is_what_is_read(client):
    for command, back in (
            ("set_payload", "get_payload"), ("set_tool_payload", "get_tool_payload"),
            ("set_tio_vout_param", "get_tio_vout_param"), ("set_tio_pin_mode", "get_tio_pin_mode"),
            ("set_rs485_chn_mode", "get_rs485_chn_mode"), ("set_rs485_chn_comm", "get_rs485_chn_comm"),
            ("set_torsenosr_brand", "get_torsenosr_brand"), ("set_torque_sensor_comm", "get_torque_sensor_comm"),
            ("set_compliant_type", "get_compliant_type"), ("set_traj_config", "get_traj_config"),
            ("set_torque_sensor_soft_limit", "get_torque_sensor_soft_limit"),
            ("set_ft_ctrl_frame", "get_ft_ctrl_frame"),
            ("set_tool_drive_frame", "get_tool_drive_frame"), ("set_torque_ref_point", "get_torque_ref_point"),
            ("set_fusion_drive_sensitivity_level", "get_fusion_drive_sensitivity_level"),
            ("set_compliant_speed_limit", "get_compliant_speed_limit"),
            ("set_end_sensor_sensitivity_threshold", "get_end_sensor_sensitivity_threshold"),
            ("set_motion_limit_warning_range", "get_motion_limit_warning_range")):
        parameters = GOOD[command][0]
        assert client.code(command, **parameters) == "0"
        index = {key: value for key, value in parameters.items() if key in ("pinType", "chnId", "chn_id")}
        reply = client.ask(back, **index)
        assert {key: reply[key] for key in parameters} == parameters
    assert client.code("set_clsn_sensitivity", sensitivityVal=5) == "0"
    assert client.ask("get_clsn_sensitivity")["sensitivityLevel"] == 5
    assert client.code("set_installation_angle", angleX=90, angleZ=180) == "0"
    assert client.ask("get_installation_angle")["installation_angle"] == [
        [0.0, 0.0, 0.707107, 0.707107], [90.0, 0.0, 180.0]]
    assert client.code("add_tio_rs_signal", **GOOD["add_tio_rs_signal"][0]) == "0"
    assert client.ask("get_rs485_signal_list") == {
        "sig1": {"chnId": 0, "sigType": 0, "sigAddr": 16, "frequency": 5, "value": 0}, "num": 1, "errorCode": "0",
        "errorMsg": "", "cmdName": "get_rs485_signal_list"}
    assert client.ask("get_tio_signals")["signals"] == [["sig1", 0, 0, 16, 0, 5]]
    assert client.code("set_admit_ctrl_config", axis=2, opt=1, ftUser=10.0, ftReboundFK=2.0, ftConstant=1.0,
                       ftNnormalTrack=0) == "0"
    assert client.ask("get_admit_ctrl_config")["admitConfig"][1:3] == [[0, 0.0, 0.0, 0.0, 0], [1, 10.0, 2.0, 1.0, 0]]
    assert client.code("set_tool_drive_config", axis=5, opt=1, rebound=0.25, rigidity=0.5) == "0"
    assert client.ask("get_tool_drive_config")["rigidity"] == [0.0] * 5 + [0.5]
    assert client.code("set_traj_sample_mode", filename="a", mode=1) == "0"
    assert client.ask("get_traj_sample_status")["sampleStatus"] == 1
    assert client.code("rename_traj_file_name", src="a", dest="b") == "0"
    assert client.ask("get_exist_traj_file_name")["trajTrackFileName"] == ["b"]
    assert client.code("remove_traj_file", fileName="b") == "0"
    assert client.ask("get_exist_traj_file_name")["trajTrackFileName"] == []
    assert client.code("modify_user_defined_variable", id_new=4, alias_new="n", value_new=7.5) == "0"
    assert client.ask("query_user_defined_variable")["var_list"] == [{"id": 4, "alias": "n", "value": 7.5}]


@pytest.mark.parametrize("text", [b"1e999", b"-1e999", b"1" + b"0" * 400])
def test_a_variable_that_is_no_finite_number_is_not_stored(client, text):
    client.send(b'{"cmdName": "modify_user_defined_variable", "id_new": 1, "value_new": %s}' % text)
    assert client.reply()["errorCode"] == "1"
    assert client.ask("query_user_defined_variable")["var_list"] == []
    for value in (7, "seven"):
        assert client.code("modify_user_defined_variable", id_new=1, value_new=value) == "0"
        assert client.ask("query_user_defined_variable")["var_list"][0]["value"] == value


@pytest.mark.parametrize("bank, digital, analog", [
    (0, "dout", "aout"), (1, "tio_dout", None), (4, "mb_slave_dout", "mb_slave_aout"),
    (5, "pn_dev_dout", "pn_dev_aout"), (6, "eip_adpt_dout", "eip_adpt_aout"), (3, "relay_io", None)])
def test_outputs_of_each_bank_show_in_the_feed(make_arm, bank, digital, analog):
    arm = make_arm(firmware="1.7", io_index_base=0)
    with RawClient(arm.command_port) as client:
        assert client.code("set_digital_output", type=bank, index=1, value=1) == "0"
        assert client.ask("get_digital_output", type=bank, index=1)["value"] == 1
        assert client.ask("get_data")[digital][:2] == [0, 1]
        if analog:
            assert client.code("set_analog_output", type=bank, index=1, value=1.25) == "0"
            assert client.ask("get_analog_output", type=bank, index=1)["value"] == 1.25
            assert client.ask("get_data")[analog][:2] == [0.0, 1.25]


@pytest.mark.parametrize("firmware, base, first", [
    ("1.5.14", None, 0), ("1.7", None, 1), ("1.7", 0, 0), ("1.5.14", 1, 1)])
def test_the_index_of_the_first_terminal(make_arm, firmware, base, first):
    arm = make_arm(firmware=firmware, io_index_base=base)
    with RawClient(arm.command_port) as client:
        assert client.code("set_digital_output", type=0, index=4, value=1) == "0"
        assert client.ask("get_digital_output", type=0, index=4)["value"] == 1
        assert client.ask("get_data")["dout"].index(1) == 4 - first
        arm.operate("set_input", index=4 - first, value=1)  # the panel counts as the feed does, from 0
        assert client.ask("get_digital_input", type=0, index=4)["value"] == 1
        below = {"type": 0, "index": first - 1}  # no other name of the first terminal
        before = client.ask("get_data")["dout"]
        assert client.code("get_digital_output", **below) == client.code("get_digital_input", **below) == "2"
        assert client.code("set_digital_output", value=1, **below) == "2"
        assert client.ask("get_data")["dout"] == before


def test_arrays_of_terminals(make_arm):
    with RawClient(make_arm(firmware="1.5.14").command_port) as client:
        assert client.code("set_digital_output", type=0, index=5, value=[1, 0, 1, 1]) == "0"
        assert client.ask("get_data")["dout"][4:10] == [0, 1, 0, 1, 1, 0]
        assert client.ask("get_digital_output", type=0, index=5, len=4)["value"] == [1, 0, 1, 1]
        assert client.code("set_analog_output", type=0, index=2, value=[1.5, 2.5]) == "0"
        assert client.ask("get_analog_output", type=0, index=2, len=2)["value"] == [1.5, 2.5]
        assert client.ask("get_digital_input", type=0, index=0, len=1)["value"] == [0]
        assert client.ask("get_analog_input", type=0, index=0, len=3)["value"] == [0.0] * 3
        before = client.ask("get_data")
        for command, wrong in (
                ("set_digital_output", {"index": 134, "value": [1, 1]}),
                ("set_digital_output", {"index": 0, "value": []}),
                ("set_analog_output", {"index": 0, "value": [1.0, 1e6]}),
                ("get_digital_output", {"index": 0, "len": 0}), ("get_analog_input", {"index": 63, "len": 2})):
            assert client.code(command, type=0, **wrong) == "2", wrong
        after = client.ask("get_data")
        assert (after["dout"], after["aout"]) == (before["dout"], before["aout"]), "all of them, or none"


def test_a_relay_that_a_client_counts_from_1(make_arm):
    # SDK 2.1.14 sends 2 for its relay 1, to every firmware.
    for firmware in ("1.5.14", "1.7"):
        with RawClient(make_arm(firmware=firmware).command_port) as client:
            assert client.code("set_digital_output", type=3, index=2, value=1) == "0"
            assert client.ask("get_digital_output", type=3, index=2)["value"] == 1


@pytest.mark.parametrize("firmware", ["1.5.14", "1.7"])
def test_signals_of_the_tools_bus_show_in_frames_as_lists(make_arm, firmware):
    # They are on the polled port, that of the SDK, on every firmware; in the feed on the modern one.
    arm = make_arm(firmware=firmware)
    with RawClient(arm.command_port) as client, RawClient(arm.poll_port) as asking:
        def signals():
            return json.loads(poll(asking))["tio_rs_signals"]
        assert signals() == []
        assert client.code("add_tio_rs_signal", frequency=5, tio_signal_chnId=1, tio_signal_name="s1",
                           tio_signal_sigAddr=16, tio_signal_sigType=2) == "0"
        assert signals() == [["s1", 1, 2, 16, 0, 5]]
        assert client.ask("get_data").get("tio_rs_signals") == (signals() if firmware == "1.7" else None)
        assert client.code("del_tio_rs_signal", tio_signal_name="s1") == "0"
        assert signals() == []


def test_a_program_that_is_not_stored_is_refused_and_the_loaded_one_stays(client):
    assert client.code("load_program", programName="weld.jks") == client.code("load_program", programName="weld") == "0"
    refused = client.ask("load_program", programName="pick.jks")
    assert (refused["errorCode"], refused["errorMsg"]) == ("2", "call load_program failed")
    assert client.ask("get_loaded_program")["programName"] == "weld"


def test_programs_have_a_state(client, feed):
    def program():
        return client.ask("get_program_state")["programState"]

    assert client.code("load_program", programName="abc.jks") == "0"
    assert client.ask("get_loaded_program")["programName"] == "abc.jks"
    assert client.code("play_program") == "0" and program() == "running"
    assert feed.until(lambda frame: frame["interp_state"] == 3)[-1]["task_mode"] == 2
    assert client.code("joint_move", jointPosition=NEAR, speed=20) == "2"  # a program is running
    assert client.code("disable_robot") == "2"
    assert client.code("pause_program") == "0" and program() == "paused"
    feed.until(lambda frame: frame["interp_state"] == 2 and frame["paused"])
    assert client.code("resume_program") == "0" and program() == "running"
    assert client.code("stop_program") == "0" and program() == "idle"
    feed.until(lambda frame: frame["interp_state"] == 0 and not frame["paused"])


def test_lost_client_aborts_motion_where_it_asked_for_that(make_arm):
    arm = make_arm(time_scale=10.0)
    with RawClient(arm.command_port) as client:
        assert client.code("set_network_exception_handle", motType=2, timeLimit=100.0) == "0"
        assert client.code("joint_move", jointPosition=[170.0, 90, -90, 90, 90, 0], speed=10) == "0"
    wait_until(lambda: not arm.state()["is_moving"] and arm.state()["queue_length"] == 0, "the abort")
    assert arm.state()["joint_position"][0] < 169.0
