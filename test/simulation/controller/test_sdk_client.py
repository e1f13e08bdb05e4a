"""The requests, needs and crashes of the arm maker's SDK; its requests byte by byte."""
import json
import socket
import time
import zlib
from pathlib import Path

import pytest
from raw_client import RawClient, RawFeed, poll
from waiting import wait_until

from jaka_ros_driver.simulation.controller.io_banks import IoBanks

REQUESTS = Path(__file__).parents[2] / "data" / "sdk" / "requests-2.1.11.txt"
# The logging server behind the recording took everything; a controller refuses these.
REFUSED = {
    "joint_move ABS 0 0.1 0 0 0 0 0 -0.5 1 0.5": "2",  # negative speed
    "joint_move ABS 0 100 0 0 0 0 0 0.5 1 0.5": "2",  # 5730 deg
    "jog -1 CONT 1 0.1 0": "2",  # no such axis
    "servo_p ABS 1 2 3 0.1 0.2 0.3 2": "2",  # inside the base
    "remove_traj_file": "2",  # no such file: it was renamed
    "shut_down": "2",  # with the drives powered
}
TERMINAL_0 = "set_analog_output 1 0 1.25"  # refused where terminals count from 1, as on 1.7
NOT_IN_THIS_MODE = [("servo_j INCR 0.001 0 0 0 0 0", "before servo_move"),
                    ("servo_move_use_joint_LPF 0.5", "in servo mode"),
                    ("joint_move4 ABS 0 0.1 1.5 -1.5 1.5 1.5 0.2 0.5", "in servo mode")]
AT_STANDSTILL = ("servo_move_enable 1", "disable_robot")
# docs/sdk-client.md section 3 and section 1, point 8: fields whose absence or shape makes it crash or misread.
SDK_READS = {
    "joint_position": 6, "joint_actual_position": 6, "actual_position": 6, "position": 6, "instVel": 6,
    "tio_din": 8, "tio_dout": 8, "tio_key": 3, "relay_io": 2, "mb_slave_din": 128, "mb_slave_ain": 64,
    "pn_dev_din": 64, "eip_adpt_din": 64, "eip_adpt_ain": 48}


def recorded():
    return [line.split("\t") for line in REQUESTS.read_text(encoding="ascii").splitlines()]


@pytest.mark.parametrize("firmware", ["1.5.14", "1.7"])
def test_every_recorded_request_is_answered_as_a_controller_would(make_arm, firmware):
    arm = make_arm(time_scale=1.0, firmware=firmware)
    codes = []
    with RawClient(arm.command_port) as client:
        client.send(b'{"cmdName":"get_version","sdk_version":"libadd jakaAPI_version: V2.1.11stable_linux"}')
        assert client.reply()["version"].startswith(firmware[:3])
        for call, request in recorded():
            if call in AT_STANDSTILL:
                assert client.code("wait_complete") == "0"
            client.send(request.encode("ascii"))
            reply = client.reply()
            if call == "servo_move_enable 0":  # it is left some cycles later
                wait_until(lambda: client.ask("is_in_servomove")["in_servomove"] is False, "the end of servo mode")
            assert type(reply["errorCode"]) is str and reply["cmdName"] == json.loads(request)["cmdName"]
            codes.append((call, reply["errorCode"]))
    assert len(codes) == 132
    not_done = [(call, code) for call, code in codes if code != "0"]
    refused = dict(REFUSED) if firmware == "1.5.14" else {TERMINAL_0: "2", **REFUSED}
    assert [(call, code) for call, code in not_done if code == "2"] == list(refused.items())
    assert [call for call, code in not_done if code == "-1"] == [call for call, _ in NOT_IN_THIS_MODE]
    assert {code for _, code in not_done} == {"2", "-1"}


@pytest.mark.parametrize("word", [b"nan", b"-nan", b"inf", b"-inf", b"NaN", b"Infinity"])
def test_bare_words_are_answered_at_once_and_once(arm, client, word):
    # Waiting for the rest of the document would hang the SDK for 25 s (docs/sdk-client.md section 1, point 6).
    client.send(b'{"cmdName":"joint_move","executing_line_id":2,"jointPosition":[%s,0.0,0.0,0.0,0.0,0.0],'
                b'"relFlag":0,"speed":28.64788975654116}' % word)
    assert client.reply(3.0) == {"errorCode": "1", "errorMsg": "Exception:function call failed"}
    assert client.ask("get_version")["errorCode"] == "0"
    assert client.ask("get_motion_state")["queue"] == 0


@pytest.mark.parametrize("firmware", ["1.5.14", "1.7"])
def test_polled_frame(make_arm, firmware):
    arm = make_arm(firmware=firmware)
    with RawClient(arm.poll_port) as client, RawFeed(arm.status_port) as feed:
        client.send(b'{"cmdName":"data_request"}')
        client.socket.settimeout(20.0)
        first = client.socket.recv(65536)
        assert first[0] == 0x78 and len(first) <= 8192
        text = zlib.decompress(first)  # in one piece
        frame = json.loads(text)
        assert frame["len"] == len(text) <= 8990 and not text.endswith(b"\n")
        assert b'"errcode": "0x0"' in text
        for name, length in SDK_READS.items():
            assert isinstance(frame[name], list) and len(frame[name]) == length, name
        for name in ("inpos", "enabled", "powered_on", "emergency_stop", "protective_stop", "on_soft_limit",
                     "motion_line", "err_add_line", "interp_state", "drag_status", "rapidrate", "current_tool_id"):
            assert isinstance(frame[name], (bool, int, float)), name
        assert frame.get("extio") is None
        sensor = frame["torqsensor"]
        assert [len(row) for row in sensor] == [3, 5] and [len(row) for row in sensor[1][2:]] == [6, 6, 6]
        assert len(frame["monitor_data"]) == 6 and len(frame["monitor_data"][5]) == 6
        assert set(feed.frame()) <= set(frame)
        assert json.loads(poll(client))["len"] == frame["len"]


def test_polled_frame_never_outgrows_what_the_sdk_takes(make_arm):
    arm = make_arm(firmware="1.7")

    def fill():
        io = arm.server.controller.state.io
        fresh = IoBanks(arm.server.controller.state.firmware)
        for bank in range(7):
            for index in range(200):
                for output in (False, True):
                    try:
                        fresh.get("analog", output, bank, index)
                    except ValueError:
                        continue
                    io.set("analog", output, bank, index, -12345.67891)
    arm.server.call(fill)
    with RawClient(arm.poll_port) as client:
        text = poll(client)
    frame = json.loads(text)
    assert frame["len"] == len(text) <= 8990
    assert "motion_line" in frame and "instVel" in frame


def test_poll_with_newlines_and_glued_polls(arm):
    with RawClient(arm.poll_port) as client:
        client.send(b'{"cmdName":"data_request"}\n{"cmdName":"data_request"}\r\n')
        client.socket.settimeout(20.0)
        data = b""
        texts = []
        while len(texts) < 2:
            data += client.socket.recv(65536)
            inflate = zlib.decompressobj()
            try:
                text = inflate.decompress(data)
            except zlib.error:
                continue
            if inflate.eof:
                texts.append(text)
                data = inflate.unused_data
                if data and len(texts) < 2:
                    texts.append(zlib.decompress(data))
        assert all(json.loads(text)["len"] == len(text) for text in texts)


def test_garbage_on_the_polled_port_is_not_answered_and_harms_nothing(arm):
    with RawClient(arm.poll_port) as client:
        client.send(b'nan{"cmdName":"power_off"}[]\n{"x":1}')
        client.socket.settimeout(0.3)
        with pytest.raises(socket.timeout):
            client.socket.recv(10)
        assert json.loads(poll(client))["enabled"] is True


def move(client, line, angle, speed=60.0):
    client.send(b'{"accel":600.0,"cmdName":"joint_move","executing_line_id":%d,"jointPosition":[%r,90.0,-90.0,90.0,'
                b'90.0,0.0],"relFlag":0,"speed":%r,"tol":0.50}' % (line, angle, speed))
    return client.reply()["errorCode"]


def test_blocking_move_ends_as_the_sdk_waits_for_it(make_arm):
    # Not in position in the first frame after acceptance; then the line's number together with inpos.
    arm = make_arm(time_scale=1.0)
    with RawClient(arm.command_port) as client, RawClient(arm.poll_port) as status:
        assert move(client, 2, 20.0, speed=10.0) == "0"
        frame = json.loads(poll(status))
        assert frame["inpos"] is False
        deadline = time.monotonic() + 20.0
        while not (frame["inpos"] and frame["motion_line"] == 2):
            assert time.monotonic() < deadline and not (frame["inpos"] and frame["motion_line"] != 2)
            frame = json.loads(poll(status))
        assert abs(frame["joint_position"][0] - 20.0) < 1e-6
        assert move(client, 3, 20.0) == "0"  # there already
        assert json.loads(poll(status))["err_add_line"] == 3
        assert move(client, 4, 10.0) == "0"
        assert json.loads(poll(status))["err_add_line"] == 0


def test_lines_of_an_earlier_client_are_forgotten(make_arm):
    # Every client begins with id 2; its old number together with inpos would end its first move at once.
    arm = make_arm(time_scale=20.0)
    with RawClient(arm.poll_port) as status:
        with RawClient(arm.command_port) as client:
            assert move(client, 2, 5.0) == "0"
            assert client.code("wait_complete") == "0"
            assert json.loads(poll(status))["motion_line"] == 2
        with RawClient(arm.command_port) as client:
            assert client.ask("get_version")["errorCode"] == "0"
            frame = json.loads(poll(status))
            assert frame["inpos"] is True and frame["motion_line"] == 0 and frame["err_add_line"] == 0


def test_lines_of_an_earlier_client_are_forgotten_though_its_move_goes_on(make_arm):
    arm = make_arm(time_scale=1.0)
    with RawClient(arm.poll_port) as status:
        with RawClient(arm.command_port) as client:
            assert move(client, 2, 100.0, speed=2.0) == "0"  # takes 50 s
            wait_until(lambda: json.loads(poll(status))["motion_line"] == 2, "the move to begin")
        with RawClient(arm.command_port) as client:
            assert client.ask("get_version")["errorCode"] == "0"
            assert arm.state()["is_moving"] and json.loads(poll(status))["motion_line"] == 0
            assert client.code("stop_program") == "0"


def test_robot_state_of_the_sdk_reads_servo_mode(client):
    assert client.ask("is_in_servomove")["in_servomove"] is False
    assert client.code("servo_move", relFlag=1) == "0"
    assert client.ask("is_in_servomove")["in_servomove"] is True
