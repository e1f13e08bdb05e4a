"""Replies whose shape is a guess, asked for when they have content, with the requests of SDK 2.1.14.

Programs of the maker's SDK crash on shapes, and an empty list has none.
"""
import json

import pytest
from raw_client import RawClient
from sdk_2_1_14 import GUESS, READS, requests

SENT = {}
for _name, _text in requests():
    SENT.setdefault(_name, []).append(_text)
SIGNALS = [{"cmdName": "add_tio_rs_signal", "frequency": 5 + n, "tio_signal_chnId": n % 2,
            "tio_signal_name": "signal %d" % n, "tio_signal_sigAddr": 16 + n, "tio_signal_sigType": n % 5}
           for n in range(8)]
# getter -> what sets content, what the reply must hold of it; None: what the setter's request holds
CONTENT = {
    "query_user_defined_variable": (["modify_user_defined_variable"], {
        "var_list": [{"id": 5500, "alias": "v1", "value": 3.5}]}),
    "get_tio_signals": (SIGNALS, {
        "signals": [["signal %d" % n, n % 2, n % 5, 16 + n, 0, 5 + n] for n in range(8)]}),
    "get_rs485_signal_list": (SIGNALS, {"num": 8, **{
        "signal %d" % n: {"sigType": n % 5, "sigAddr": 16 + n, "chnId": n % 2, "frequency": 5 + n, "value": 0}
        for n in range(8)}}),
    "get_tio_vout_param": (["set_tio_vout_param"], None),
    "get_tio_pin_mode": (["set_tio_pin_mode"], None),
    "get_rs485_chn_mode": (["set_rs485_chn_mode"], None),
    "get_rs485_chn_comm": (["set_rs485_chn_comm"], None),
    "get_motion_limit_warning_range": (["set_motion_limit_warning_range"], None),
    "get_torsenosr_brand": (["set_torsenosr_brand"], None),
    "get_compliant_type": (["set_compliant_type"], None),
    "get_torque_sensor_comm": (["set_torque_sensor_comm"], None),
    "get_torque_sensor_filter": (["set_torque_sensor_filter"], None),
    "get_torque_sensor_soft_limit": (["set_torque_sensor_soft_limit"], None),
    "get_ft_ctrl_frame": (["set_ft_ctrl_frame"], None),
    "get_traj_config": (["set_traj_config"], None),
    "get_traj_sample_status": (["set_traj_sample_mode"], {"sampleStatus": 1}),
    "get_exist_traj_file_name": (["set_traj_sample_mode", {
        "cmdName": "set_traj_sample_mode", "filename": "trajC", "mode": 1}], {
            "trajTrackFileName": ["trajA", "trajC"]}),
    "get_admit_ctrl_config": (["set_admit_ctrl_config"], {}),
    "get_tool_drive_config": (["set_tool_drive_config"], {}),
    "get_tool_drive_frame": (["set_tool_drive_frame"], None),
    "get_fusion_drive_sensitivity_level": (["set_fusion_drive_sensitivity_level"], None),
    "get_compliant_speed_limit": (["set_compliant_speed_limit"], None),
    "get_torque_ref_point": (["set_torque_ref_point"], None),
    "get_end_sensor_sensitivity_threshold": (["set_end_sensor_sensitivity_threshold"], None),
    "get_torque_sensor_data": ([], {}),
    "get_loaded_program": (["load_program"], {"programName": "abc.jks"}),
    "get_tool_payload": (["set_tool_payload"], None),
    "get_version": ([], {"version": "1.7.2_16_X64", "robot_name": "zu7", "robot_id": "0"}),
}
WITHOUT = {  # nothing that a client sends gives these another content here
    "get_torq_sensor_identify_staus": {"identify_status": 0},
    "get_torq_sensor_payload_identify_result": {"mass": 0.0, "centroid": [0.0] * 3},
    "get_tool_drive_stat": {"tool_drive_stat": 0},
}


def ask(client, request):
    client.send(request if isinstance(request, bytes) else json.dumps(request).encode())
    return client.reply()


def test_no_guess_is_left_out():
    guesses = {name for name, (evidence, _) in READS.items() if evidence == GUESS}
    assert guesses - set(CONTENT) == set(WITHOUT) and not set(CONTENT) & set(WITHOUT)


@pytest.mark.parametrize("firmware", ["1.5.14", "1.7.2"])
@pytest.mark.parametrize("getter", CONTENT)
def test_with_content(make_arm, getter, firmware):
    setters, expected = CONTENT[getter]
    arm = make_arm(firmware=firmware)
    with RawClient(arm.command_port) as client:
        held = {}
        for setter in setters:
            request = setter if isinstance(setter, dict) else json.loads(SENT[setter][-1])
            assert ask(client, request)["errorCode"] == "0"
            held.update(request)
        getters = SENT.get(getter) or [{"cmdName": getter}]
        reply = ask(client, getters[-1])
    assert reply["errorCode"] == "0" and reply["cmdName"] == getter
    if expected is None:
        expected = {key: value for key, value in held.items() if key in reply and key != "cmdName"}
        assert set(expected) >= set(held) - {"cmdName"}, "the reply lacks a part of the setting"
    if firmware == "1.5.14" and getter == "get_version":
        expected = {**expected, "version": "1.5.14_13_X64"}
    assert {key: reply[key] for key in expected} == expected


@pytest.mark.parametrize("getter", WITHOUT)
def test_without_content(client, getter):
    reply = ask(client, SENT[getter][-1])
    assert {key: reply[key] for key in WITHOUT[getter]} == WITHOUT[getter]


def test_axes_and_sensor_readings_have_content(make_arm):
    arm = make_arm(firmware="1.7.2", force_sensor=True)
    with RawClient(arm.command_port) as client:
        for axis in range(6):
            assert ask(client, {"cmdName": "set_admit_ctrl_config", "axis": axis, "opt": 1, "ftUser": axis + 0.5,
                                "ftReboundFK": 2.0, "ftConstant": 3.0, "ftNnormalTrack": 1})["errorCode"] == "0"
            assert ask(client, {"cmdName": "set_tool_drive_config", "axis": axis, "opt": 1, "rigidity": axis + 0.5,
                                "rebound": 2.0})["errorCode"] == "0"
        assert ask(client, {"cmdName": "get_admit_ctrl_config"})["admitConfig"] == [
            [1, axis + 0.5, 2.0, 3.0, 1] for axis in range(6)]
        drive = ask(client, {"cmdName": "get_tool_drive_config"})
        assert (drive["opt"], drive["rigidity"], drive["rebound"]) == (
            [1] * 6, [axis + 0.5 for axis in range(6)], [2.0] * 6)
        arm.operate("load_force_sensor", fx=1.5, fy=2.5, fz=3.5, mx=0.1, my=0.2, mz=0.3)
        reply = ask(client, {"cmdName": "get_torque_sensor_data", "type": 1})
        assert reply["torque_sensor_data"] == [1.5, 2.5, 3.5, 0.1, 0.2, 0.3]


@pytest.mark.parametrize("name", ["len", "num", "errorCode", "errorMsg", "cmdName", "signals"])
def test_no_signal_name_spoils_the_reply(client, name):
    assert ask(client, dict(SIGNALS[0], tio_signal_name=name))["errorCode"] == "0"
    reply = ask(client, {"cmdName": "get_rs485_signal_list"})
    assert (reply["num"], reply["errorCode"], reply["cmdName"]) == (1, "0", "get_rs485_signal_list")
    if name in ("len", "signals"):
        assert reply[name]["sigAddr"] == 16
    assert ask(client, {"cmdName": "get_tio_signals"})["signals"] == [[name, 0, 0, 16, 0, 5]]


def test_a_ninth_signal_is_refused(client):
    for request in SIGNALS:
        assert ask(client, request)["errorCode"] == "0"
    assert ask(client, dict(SIGNALS[0], tio_signal_name="ninth"))["errorCode"] == "2"
    assert ask(client, {"cmdName": "get_rs485_signal_list"})["num"] == 8
