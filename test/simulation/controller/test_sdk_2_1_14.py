"""Every request of the maker's SDK 2.1.14, byte by byte, is answered with the keys and types that it reads."""
import json

import pytest
from raw_client import RawClient
from sdk_2_1_14 import REFUSED, has_shape, read_in, refusal, requests

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
