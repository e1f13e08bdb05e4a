"""The requests of the maker's SDK 2.1.14, byte by byte, answered with the keys and types that it reads."""
import json

import pytest
from raw_client import RawClient
from sdk_2_1_14 import REFUSED, has_shape, read_in, refusal, requests
from waiting import wait_until

FIRMWARES = ["1.5.14", "1.7.1", "1.7.2"]
STARTS = {"power_on": "off", "shutdown": "off", "power_off": "powered", "enable_robot": "powered"}
BEFORE = {
    "servo_j": [{"cmdName": "servo_move", "relFlag": 1}],
    "servo_p": [{"cmdName": "servo_move", "relFlag": 1}],
    "play_program": [{"cmdName": "load_program", "programName": "abc.jks"}],
    "del_tio_rs_signal": [{"cmdName": "add_tio_rs_signal", "frequency": 5, "tio_signal_chnId": 1,
                           "tio_signal_name": "sig1", "tio_signal_sigAddr": 16, "tio_signal_sigType": 2}],
    "remove_traj_file": [{"cmdName": "set_traj_sample_mode", "filename": "trajB", "mode": 1}],
}


def test_the_record_is_whole():
    known = requests()
    assert len(known) == 133 and len({name for name, _ in known}) == 123
    assert all(json.loads(request)["cmdName"] == name for name, request in known)
    assert all(sum(piece in request.decode() for _, request in known) >= 1 for piece in REFUSED)


@pytest.mark.parametrize("firmware", FIRMWARES)
@pytest.mark.parametrize("command, request_", requests(), ids=lambda value: value if isinstance(value, str) else "")
def test_it_is_answered_as_the_sdk_reads_it(make_arm, firmware, command, request_):
    arm = make_arm(firmware=firmware, start=STARTS.get(command, "enabled"), power_delay=0.1, enable_delay=0.1)
    with RawClient(arm.command_port) as client:
        for before in BEFORE.get(command, ()):
            client.send(json.dumps(before).encode())
            assert client.reply()["errorCode"] == "0"
        client.send(request_)
        reply = client.reply()
    assert reply["errorCode"] == refusal(request_) and reply["cmdName"] == command
    if reply["errorCode"] == "0":
        for key, shape in read_in(command, firmware)[1].items():
            assert has_shape(reply[key], shape), "%s: %r" % (key, reply[key])


@pytest.mark.parametrize("firmware", FIRMWARES)
def test_leaving_servo_mode_is_seen_as_the_sdk_needs_it(make_arm, firmware):
    # It answers -61 unless a poll 1 ms after ``servo_move`` 0 still reads true, and one within 1 s false.
    arm = make_arm(firmware=firmware, time_scale=1.0)
    with RawClient(arm.command_port) as client:
        assert client.code("servo_move", relFlag=1) == "0"
        client.send(b'{"cmdName":"servo_move","relFlag":0}{"cmdName":"is_in_servomove"}')
        assert client.reply()["errorCode"] == "0" and client.reply()["in_servomove"] is True
        began = arm.state()["simulated_s"]
        wait_until(lambda: client.ask("is_in_servomove")["in_servomove"] is False, "the end of servo mode")
        assert arm.state()["simulated_s"] - began < 1.0


@pytest.mark.parametrize("firmware, is_early", [("1.5.14", False), ("1.7.1", True), ("1.7.2", True)])
@pytest.mark.parametrize("command, start, key", [
    ("power_on", "off", "powered_on"), ("enable_robot", "powered", "enabled")])
def test_slow_commands_are_answered_as_evidence_says(make_arm, command, start, key, firmware, is_early):
    arm = make_arm(firmware=firmware, start=start, time_scale=20.0, power_delay=8.0, enable_delay=4.0)
    with RawClient(arm.command_port) as client:
        begun, look = b'{"cmdName":"%s"}' % command.encode(), b'{"cmdName":"get_data"}'
        client.send(begun + look if is_early else begun)  # glued, so that nothing can come between
        assert client.reply()["errorCode"] == "0"
        if not is_early:
            client.send(look)
        assert bool(client.reply()[key]) is not is_early
        wait_until(lambda: client.ask("get_data")[key], "the drives")


@pytest.mark.parametrize("firmware, event", [("1.5.14", "0x0"), ("1.7.1", "0xf0017"), ("1.7.2", "0xf0017")])
def test_a_refused_move_shows_its_event_where_evidence_says_so(make_arm, firmware, event):
    request = next(text for name, text in requests() if name == "moveL" and refusal(text) == "2")
    with RawClient(make_arm(firmware=firmware).command_port) as client:
        client.send(request)
        assert client.reply()["errorCode"] == "2" and client.ask("get_data")["errcode"] == event
        assert client.code("joint_move", jointPosition=[1, 90, -90, 90, 90, 0], speed=5) == "0"  # nothing latched
        assert client.ask("get_data")["errcode"] == "0x0"
