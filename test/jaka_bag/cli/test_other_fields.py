"""Logs whose types have known names and other fields: they are compared and drawn as what they are, or not at all."""
import struct

import pytest
from log_samples import START_NS, Sample, connection, state_log, write

from jaka_bag.cli.main import main

ON = struct.pack("<I", 2) + b"on"
CASES = [
    ("joint_position", "sensor_msgs/JointState", "string[] position\n", struct.pack("<I", 1) + ON),
    ("joint_position", "sensor_msgs/JointState", "float64[] position\nuint8 name\n", struct.pack("<IdB", 1, 0.5, 1)),
    ("joint_position", "sensor_msgs/JointState", "uint8 name\n", b"1"),
    ("tool_position", "geometry_msgs/TwistStamped", "float64 speed\n", bytes(8)),
    ("tool_position", "geometry_msgs/PoseStamped", "float64 speed\n", bytes(8)),
    ("robot_states", "jaka_msgs/RobotMsg", "string motion_state\nint16 power_state\nint16 servo_state\n"
     "int16 collision_state\n", ON + bytes(6)),
    ("robot_states", "jaka_msgs/RobotMsg", "int16[] motion_state\nint16 power_state\nint16 servo_state\n"
     "int16 collision_state\n", struct.pack("<I2h", 2, 1, 1) + bytes(6))]


@pytest.mark.parametrize("name, datatype, definition, data", CASES)
def test_a_known_type_with_other_fields(tmp_path, capsys, name, datatype, definition, data):
    kind = connection("/other/" + name, datatype, definition)
    log = write(tmp_path / "log.bag", [Sample(kind, START_NS + i * 10**8, data) for i in range(3)] + state_log(0.1))
    assert main(["compare", str(log), str(log), "-q"]) == 0
    assert main(["plot", str(log), "-o", str(tmp_path / "log.svg")]) == 0
    assert "Traceback" not in capsys.readouterr().err
