"""Logs with calls of both definitions of ServoMove: a client that is built anew asks for the same as before."""
import struct

import pytest
from import_graph import ROOT

from jaka_bag.compare.audit.editing import read_log, write_log
from jaka_bag.compare.comparison import compare_logs
from jaka_bag.driver_interface import CALL_TYPE, plain_request

GOLDEN = ROOT / "test" / "data" / "golden" / "servo_stream.mcap"
POSE_MD5, WITH_SPEED_MD5 = "7dad889723cef7fc192c47c7bdf495f2", "ea058e08a9ca2790743a486fd4bfb151"
POSE = struct.pack("<I6f", 6, 0.0, 1.5, -1.5, 1.5, 1.5, 0.0)


def speed(*values):
    return struct.pack("<I%df" % len(values), len(values), *values)


@pytest.mark.parametrize("md5sum, request_bytes, meaning", [
    (POSE_MD5, POSE, (POSE_MD5, POSE)), (WITH_SPEED_MD5, POSE + speed(), (POSE_MD5, POSE)),
    (WITH_SPEED_MD5, POSE + speed(0.0), (POSE_MD5, POSE + speed(0.0))),
    (WITH_SPEED_MD5, speed() + speed(), (POSE_MD5, speed())), (WITH_SPEED_MD5, POSE, (POSE_MD5, POSE)),
    (WITH_SPEED_MD5, b"", (POSE_MD5, b"")), ("0" * 32, POSE + speed(), ("0" * 32, POSE + speed()))])
def test_an_empty_speed_is_the_same_as_none(md5sum, request_bytes, meaning):
    assert plain_request(md5sum, request_bytes) == meaning


def rebuilt(value, values):
    """Return a recorded call, one of ServoMove as that of a client that was built with ``speed``."""
    if value["service_type"] == "jaka_msgs/ServoMove":
        assert value["md5sum"] == POSE_MD5
        value.update(md5sum=WITH_SPEED_MD5, request=bytes(value["request"]) + speed(*values),
                     request_text=value["request_text"] + "\nspeed: %s" % list(values))
    return value


@pytest.mark.parametrize("values, is_same", [((), True), ((0.5,), False)])
def test_a_log_of_the_other_definition_is_the_same_while_speed_is_empty(values, is_same, tmp_path):
    log = read_log(GOLDEN)
    write_log(log.with_items([log.with_value(item, rebuilt(log.value(item), values))
                              if log.connections[item.topic].datatype == CALL_TYPE else item for item in log.items]),
              tmp_path / "candidate.mcap")
    comparison = compare_logs(GOLDEN, tmp_path / "candidate.mcap")
    assert comparison.same == is_same, comparison.differences
