"""The two definitions of ServoMove.srv on the wire: clients built with either one, and with none (md5 *)."""
import contextlib
import io
import socket
import struct
import subprocess
from pathlib import Path

import genmsg.gentools
import genmsg.msg_loader
import genpy.dynamic
import pytest
import rosgraph
import rosgraph.network
import rospy
from driver_bench import HOME, evidence_of
from import_graph import ROOT
from std_srvs.srv import Trigger
from waiting import eventually

from jaka_msgs.srv import ClearErr, ClearError, Move, ServoMove, ServoMoveEnable, ServoMoveRequest, ServoMoveResponse
from jaka_ros_driver.ros.services.wire_definitions import (
    ServoMoveAnyRequest,
    ServoMovePoseRequest,
    ServoMoveWithSpeedRequest,
    other_definitions,
)

WITH_SPEED = "float32[] pose\nfloat32[] speed\n---\nint16 ret\nstring message\n"
POSE = WITH_SPEED.replace("float32[] speed\n", "")
POSE_MD5 = "7dad889723cef7fc192c47c7bdf495f2"
REFUSAL = "not in servo mode"
GENCPP = Path("/usr/lib/gencpp/gen_cpp.py")


def md5_of(text):
    context = genmsg.MsgContext.create_default()
    spec = genmsg.msg_loader.load_srv_from_string(context, text, "jaka_msgs/ServoMove")
    return genmsg.gentools.compute_md5(context, spec), genmsg.gentools.compute_md5(context, spec.request)


@pytest.fixture(scope="module")
def pose_service():
    """Return the service type as another workspace's generator makes it of the documented definition."""
    name = "jaka_msgs/ServoMoveRequest"
    request = genpy.dynamic.generate_dynamic(name, POSE.split("---")[0])[name]
    md5 = md5_of(POSE)[0]
    return type("ServoMove", (), {"_type": "jaka_msgs/ServoMove", "_md5sum": md5, "_request_class": request,
                                  "_response_class": ServoMoveResponse})


def floats(*values):
    return struct.pack("<I%df" % len(values), len(values), *values)


def raw_call(service, md5sum, body, persistent=False, count=1):
    """Call a service as the wire's description defines it; return (answer's header, responses)."""
    host, port = rospy.core.parse_rosrpc_uri(rosgraph.Master("/raw").lookupService(service))
    header = {"service": service, "md5sum": md5sum, "callerid": "/raw_client", "type": "jaka_msgs/ServoMove"}
    with contextlib.closing(socket.create_connection((host, port), 20)) as link:
        rosgraph.network.write_ros_handshake_header(link, dict(header, **({"persistent": "1"} if persistent else {})))
        stream = link.makefile("rb")
        answered = rosgraph.network.decode_ros_handshake_header(_block(stream, with_length=True))
        responses = []
        for _ in range(count):
            link.sendall(struct.pack("<I", len(body)) + body)
            ok = stream.read(1)
            assert ok == b"\x01", _block(stream)
            responses.append(ServoMoveResponse().deserialize(_block(stream)))
        return answered, responses


def _block(stream, with_length=False):
    length = stream.read(4)
    return (length if with_length else b"") + stream.read(struct.unpack("<I", length)[0])


def test_the_md5s_are_those_of_the_definitions():
    assert md5_of(WITH_SPEED) == (ServoMove._md5sum, ServoMoveWithSpeedRequest._md5sum)
    assert md5_of(POSE) == (POSE_MD5, ServoMovePoseRequest._md5sum)
    assert list(other_definitions(ServoMove)) == [POSE_MD5, "*"]
    assert [*other_definitions(ClearErr)] == [ClearError._md5sum]
    assert [*other_definitions(ClearError)] == [ClearErr._md5sum]


@pytest.mark.parametrize("srv_type", [Move, ServoMoveEnable, Trigger])
def test_a_service_of_any_other_type_takes_the_installed_definition_alone(srv_type):
    assert other_definitions(srv_type) == {}


@pytest.mark.parametrize("pose, speed", [([], []), ([1.5] * 6, []), ([0.25] * 6, [1.0, 2.0])])
def test_our_reader_and_the_generated_one_agree(pose_service, pose, speed):
    for generated, reader in ((ServoMoveRequest(pose, speed), ServoMoveWithSpeedRequest),
                              (ServoMoveRequest(pose, speed), ServoMoveAnyRequest),
                              (pose_service._request_class(pose), ServoMovePoseRequest)):
        theirs, ours = io.BytesIO(), io.BytesIO()
        generated.serialize(theirs)
        read = reader().deserialize(theirs.getvalue())
        assert [list(getattr(read, name)) for name in read.__slots__] == [pose, speed][:len(read.__slots__)]
        read.serialize(ours)
        assert ours.getvalue() == theirs.getvalue()


@pytest.mark.parametrize("cut", range(0, 36, 5))
def test_a_request_that_ends_too_early_is_an_error_of_its_own_kind(cut):
    for kind in (ServoMoveWithSpeedRequest, ServoMoveAnyRequest):
        with pytest.raises(genpy.DeserializationError):
            kind().deserialize((floats(*HOME) + floats(1.0))[:cut])
    if cut < len(floats(*HOME)):
        with pytest.raises(genpy.DeserializationError):
            ServoMovePoseRequest().deserialize(floats(*HOME)[:cut])


@pytest.mark.parametrize("service", ["servo_j", "servo_p"])
def test_a_python_client_of_either_definition(arm, pose_service, service):
    for kind, fields in ((pose_service, {"pose": HOME}), (ServoMove, {"pose": HOME, "speed": [0.5]})):
        for persistent in (False, True):
            proxy = rospy.ServiceProxy("%s/%s" % (arm.name, service), kind, persistent=persistent)
            for _ in range(2):
                answer = proxy(**fields)
                assert answer.ret == 0 and REFUSAL in answer.message
            proxy.close()


@pytest.mark.parametrize("md5sum, body", [
    (POSE_MD5, floats(*HOME)), (ServoMove._md5sum, floats(*HOME) + floats()),
    (ServoMove._md5sum, floats(*HOME) + floats(1.0, 2.0)), ("*", floats(*HOME)),
    ("*", floats(*HOME) + floats(1.0))], ids=["pose", "empty speed", "with speed", "any", "any, with speed"])
def test_a_client_by_its_bytes(arm, md5sum, body):
    with evidence_of(arm) as call_publisher:
        header, responses = raw_call(arm.name + "/servo_j", md5sum, body, persistent=True, count=3)
        assert eventually(lambda: len(call_publisher()) == 3)
    assert all(response.ret == 0 and REFUSAL in response.message for response in responses)
    known = ServoMove._md5sum if md5sum == "*" else md5sum
    assert header["md5sum"] == known and header["type"] == "jaka_msgs/ServoMove"
    for call in call_publisher():
        assert call.md5sum == known and call.caller == "/raw_client"
        assert md5sum == "*" or bytes(call.request) == body


def test_a_client_of_a_third_definition_is_refused(arm):
    proxy = rospy.ServiceProxy(arm.name + "/servo_j", type("Other", (ServoMove,), {"_md5sum": "0" * 32}))
    with pytest.raises(rospy.ServiceException, match="md5sums do not match"):
        proxy(pose=HOME)


def test_the_documents_definition_moves_the_arm(arm, pose_service):
    arm.go_home()
    assert arm.call("servo_move_enable", enable=True).ret == 1
    proxy = rospy.ServiceProxy(arm.name + "/servo_j", pose_service)
    assert proxy(pose=[0.03] + HOME[1:]).ret == 1
    assert eventually(lambda: arm.simulator.state()["joint_position"][0] > 1.7)
    assert arm.call("servo_move_enable", enable=False).ret == 1


@pytest.mark.parametrize("service_type", [ClearErr, ClearError])
def test_clear_err_serves_clients_of_both_types_and_says_which(arm, service_type):
    fields = {"enable": True} if service_type is ClearError else {}
    with evidence_of(arm) as calls:
        assert rospy.ServiceProxy(arm.name + "/clear_err", service_type)(**fields).ret == 1
        assert eventually(lambda: len(calls()) == 1)
    assert (calls()[0].service_type, calls()[0].md5sum) == (service_type._type, service_type._md5sum)


def test_a_clear_error_with_enable_false_clears_nothing(arm):
    answer = rospy.ServiceProxy(arm.name + "/clear_err", ClearError)(enable=False)
    assert answer.ret == 0 and "enable is false" in answer.message


@pytest.fixture(scope="module", params=["installed", "pose"])
def cpp_client(request, tmp_path_factory):
    """Build a roscpp executable with one of the definitions."""
    folder = tmp_path_factory.mktemp("cpp")
    definition = ROOT / "jaka_msgs" / "srv" / "ServoMove.srv"
    flags = ["-DWITH_SPEED"]
    if request.param == "pose":
        definition = folder / "ServoMove.srv"
        definition.write_text(POSE)
        flags = []
    headers = folder / "include" / "jaka_msgs"
    headers.mkdir(parents=True)
    program = folder / "call_servo_move"
    for command in (["/usr/bin/python3", str(GENCPP), str(definition), "-p", "jaka_msgs", "-o", str(headers),
                     "-e", "/usr/share/gencpp"],
                    ["g++", "-std=c++17", *flags, "-I", str(headers.parent), "-o", str(program),
                     str(Path(__file__).parent / "cpp" / "call_servo_move.cpp"),
                     "-lroscpp", "-lrosconsole", "-lroscpp_serialization", "-lrostime", "-lcpp_common"]):
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=240)
        assert done.returncode == 0, done.stdout
    return program


@pytest.mark.parametrize("service", ["servo_j", "servo_p"])
def test_a_cpp_client_of_either_definition(arm, cpp_client, service):
    with evidence_of(arm) as call_publisher:
        done = subprocess.run([str(cpp_client), "%s/%s" % (arm.name, service), *map(str, HOME)],
                              stdout=subprocess.PIPE, text=True, timeout=60)
        assert eventually(lambda: len(call_publisher()) == 4)
    assert done.returncode == 0
    assert [line.startswith("0 ") and REFUSAL in line for line in done.stdout.splitlines()] == [True] * 4, done.stdout


def test_a_cpp_client_moves_the_arm(arm, cpp_client):
    arm.go_home()
    assert arm.call("servo_move_enable", enable=True).ret == 1
    done = subprocess.run([str(cpp_client), arm.name + "/servo_j", "0.02", *map(str, HOME[1:])],
                          stdout=subprocess.PIPE, text=True, timeout=60)
    assert [line.split()[0] for line in done.stdout.splitlines()] == ["1"] * 4, done.stdout
    assert eventually(lambda: arm.simulator.state()["joint_position"][0] > 1.1)
    assert arm.call("servo_move_enable", enable=False).ret == 1
