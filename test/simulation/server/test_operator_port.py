"""The operator port of the simulated controller: each action and each wire fault, as a client on the wire sees it."""
import json
import socket
import time
import zlib

import pytest
from raw_client import RawClient, RawFeed, poll
from waiting import wait_until

from jaka_ros_driver.errors import ConnectionLost, InvalidCommand
from jaka_ros_driver.simulation.dialect.table import Dialect
from jaka_ros_driver.simulation.server.event_loop import ask_operator_port
from jaka_ros_driver.simulation.server.faults import KINDS
from jaka_ros_driver.simulation.server.operator_actions import ACTIONS

REPLY = (b'{"version": "1.5.14_13_X64", "robot_name": "zu7", "robot_id": "0", "errorCode": "0", "errorMsg": "", '
         b'"cmdName": "get_version"}')


def read_until_silence(link, silence=0.3):
    """Return pieces as they came, each with its time."""
    link.settimeout(silence)
    pieces = []
    try:
        while True:
            data = link.recv(65536)
            if not data:
                pieces.append((time.monotonic(), b""))
                return pieces
            pieces.append((time.monotonic(), data))
    except socket.timeout:
        return pieces


def ask_version(client):
    client.send(b'{"cmdName": "get_version"}')


def test_split(arm, client):
    arm.operate("fault", kind="split", port="command", bytes=10, gap_ms=20)
    ask_version(client)
    pieces = read_until_silence(client.socket)
    assert b"".join(data for _, data in pieces) == REPLY and len(pieces) >= 5
    ask_version(client)  # one message was to be struck
    assert [data for _, data in read_until_silence(client.socket)] == [REPLY]


def test_merge(arm, client):
    arm.operate("fault", kind="merge", port="command", hold_ms=100)
    ask_version(client)
    ask_version(client)
    assert [data for _, data in read_until_silence(client.socket)] == [REPLY + REPLY]


def test_delay_holds_up_what_follows(arm, client):
    arm.operate("fault", kind="delay", port="command", delay_ms=300, command="get_version")
    began = time.monotonic()
    client.send(b'{"cmdName": "get_version"}{"cmdName": "get_payload"}')
    assert client.reply()["cmdName"] == "get_version"
    assert time.monotonic() - began >= 0.3
    assert client.reply()["cmdName"] == "get_payload"


def test_drop_concerns_the_named_command_only(arm, client):
    arm.operate("fault", kind="drop", port="command", command="get_version")
    assert client.ask("get_payload")["errorCode"] == "0"
    client.send(b'{"cmdName": "get_version"}{"cmdName": "get_joint_pos"}')
    assert client.reply()["cmdName"] == "get_joint_pos"
    assert client.ask("get_version")["errorCode"] == "0"


def test_duplicate(arm, client):
    arm.operate("fault", kind="duplicate", port="command")
    ask_version(client)
    assert client.reply() == client.reply()
    assert client.is_silent(0.1)


def test_reorder(arm, client):
    arm.operate("fault", kind="reorder", port="command", hold_ms=2000)
    client.send(b'{"cmdName": "get_version"}{"cmdName": "get_payload"}')
    assert [client.reply()["cmdName"] for _ in range(2)] == ["get_payload", "get_version"]


def test_reorder_without_a_second_message_sends_the_first_after_all(arm, client):
    arm.operate("fault", kind="reorder", port="command", hold_ms=100)
    ask_version(client)
    assert client.reply()["cmdName"] == "get_version"


@pytest.mark.parametrize("kind, rest", [("garbage", REPLY), ("noise", b"")])
def test_garbage_and_noise(arm, client, kind, rest):
    arm.operate("fault", kind=kind, port="command", bytes=20)
    ask_version(client)
    data = b"".join(data for _, data in read_until_silence(client.socket))
    assert len(data) == 20 + len(rest) and data[20:] == rest and min(data[:20]) >= 0x80


def test_wrong_len(arm):
    with RawFeed(arm.status_port) as feed, RawClient(arm.poll_port) as status:
        feed.frame()
        arm.operate("fault", kind="wrong_len", port="poll", offset=3)
        text = poll(status)
        assert json.loads(text)["len"] == len(text) + 3
        assert json.loads(poll(status))["len"] == len(poll(status))
        arm.operate("fault", kind="wrong_len", port="status", offset=-7, count=None)
        data = b""
        for _ in range(10):
            data += feed.socket.recv(65536)
        last = data[data.rindex(b'{"len": ', 0, data.rindex(b'{"len": ')):data.rindex(b'{"len": ')]
        assert json.loads(last)["len"] == len(last) - 7


def test_cut_ends_the_connection_in_the_middle_of_a_message(arm, client):
    arm.operate("fault", kind="cut", port="command", bytes=12)
    ask_version(client)
    assert [data for _, data in read_until_silence(client.socket)] == [REPLY[:12], b""]


@pytest.mark.parametrize("port", ["command", "status", "poll"])
def test_close_and_reset_in_place_of_a_message(arm, port):
    for kind in ("close", "reset"):
        with RawClient(getattr(arm, port + "_port")) as link:
            wait_until(lambda: arm.operate("wire")["wire"]["connections"], "the connection")
            arm.operate("fault", kind=kind, port=port)
            if port != "status":
                link.send(b'{"cmdName": "data_request"}')
            assert link.is_closed()
        wait_until(lambda: not arm.operate("wire")["wire"]["connections"], "its end")


def test_half_open_in_place_of_a_reply(arm, client):
    arm.operate("fault", kind="half_open", port="command", command="get_version")
    assert client.code("get_payload") == "0"
    ask_version(client)
    assert client.is_silent(0.3)
    ask_version(client)
    assert client.is_silent(0.2)
    with RawClient(arm.command_port) as fresh:
        assert fresh.code("get_version") == "0"


@pytest.mark.parametrize("action", ["close", "reset", "half_open"])
def test_all_connections_end_at_once(arm, action):
    with RawClient(arm.command_port) as client, RawFeed(arm.status_port) as feed, RawClient(arm.poll_port) as status:
        assert client.code("get_version") == "0" and feed.frame() and poll(status)
        assert arm.operate(action)["connections"] == 3
        if action == "half_open":
            ask_version(client)
            status.send(b'{"cmdName":"data_request"}')
            read_until_silence(feed.socket, 0.2)
            assert [read_until_silence(link.socket, 0.2) for link in (client, feed, status)] == [[], [], []]
            assert all(connection["half_open"] for connection in arm.operate("wire")["wire"]["connections"])
        elif action == "close":
            assert client.is_closed() and feed.is_closed() and status.is_closed()
        else:
            with pytest.raises(ConnectionResetError):
                client.socket.recv(1)


def test_stall_of_the_command_port(arm, client, feed):
    assert client.code("get_version") == "0"
    began = time.monotonic()
    arm.operate("stall", port="command", duration_ms=400)
    ask_version(client)
    assert feed.frame()["enabled"] is True  # the others go on
    assert client.reply()["errorCode"] == "0" and time.monotonic() - began >= 0.35


def test_stall_of_the_feed(arm, feed):
    feed.frame()
    began = time.monotonic()
    arm.operate("stall", port="status", duration_ms=1000)
    times = []
    while time.monotonic() - began < 2.0:
        feed.raw_frame()
        times.append(time.monotonic())
    assert max(later - earlier for earlier, later in zip([began, *times], times)) >= 0.3


def test_refuse_and_then_serve_again(arm, client):
    arm.operate("refuse", port="status", duration_ms=500)
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", arm.status_port), 5.0)
    assert client.code("get_version") == "0"

    def comes_back():
        try:
            return RawFeed(arm.status_port)
        except ConnectionRefusedError:
            return None
    with wait_until(comes_back, "the port to be back") as feed:
        assert feed.frame()["enabled"] is True


@pytest.mark.parametrize("silent", [0, 1])
def test_reboot_forgets_what_is_volatile(arm, silent):
    with RawClient(arm.command_port) as client, RawFeed(arm.status_port) as feed:
        assert client.code("set_port10000_delay_ms", port10000_delay_ms=8) == "0"
        assert client.code("set_tool_offsets", tooloffset=[0, 0, 9, 0, 0, 0], id=4, name="kept") == "0"
        assert client.code("joint_move", jointPosition=[170, 90, -90, 90, 90, 0], speed=20) == "0"
        feed.until(lambda frame: frame["joint_actual_position"][0] > 1.0)
        arm.operate("reboot", down=0.3, silent=silent)
        with pytest.raises(ConnectionRefusedError):
            socket.create_connection(("127.0.0.1", arm.command_port), 5.0)
        if silent:
            read_until_silence(feed.socket, 0.1)
        else:
            assert client.is_closed()
        wait_until(lambda: not arm.operate("wire")["wire"]["is_off"], "the end of the reboot")
        assert client.is_closed() and feed.is_closed()
    with RawClient(arm.command_port) as client, RawFeed(arm.status_port) as feed:
        frame = feed.frame()
        assert (frame["powered_on"], frame["enabled"], frame["inpos"]) == (0, False, True)
        assert 1.0 < frame["joint_actual_position"][0] < 169.0 and not arm.state()["is_moving"]
        assert client.ask("get_port10000_delay_ms")["port10000_delay_ms"] == 30
        assert client.ask("get_tool_offsets")["tool_offsets"][4][2] == 9.0


def test_reboot_keeps_the_persistent_period_and_a_pressed_button(arm):
    with RawClient(arm.command_port) as client:
        assert client.code("setOptionalInfoConfig", section="PORTCONFIG", key="port10000_delay_ms", value="12") == "0"
        assert client.ask("get_port10000_delay_ms")["port10000_delay_ms"] == 12
    arm.operate("press_emergency_stop")
    arm.operate("reboot", down=0)
    wait_until(lambda: not arm.operate("wire")["wire"]["is_off"], "the end of the reboot")
    with RawClient(arm.command_port) as client, RawFeed(arm.status_port) as feed:
        assert client.ask("get_port10000_delay_ms")["port10000_delay_ms"] == 12
        assert feed.frame()["emergency_stop"] == 1


def test_shutdown_turns_the_cabinet_off_until_the_operator_boots_it(make_arm):
    arm = make_arm(start="off")
    with RawClient(arm.command_port) as client, RawFeed(arm.status_port) as feed:
        assert client.code("shutdown") == "0"
        assert client.is_closed() and feed.is_closed()
    wait_until(lambda: arm.operate("wire")["wire"]["is_off"], "the cabinet to be off")
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", arm.command_port), 5.0)
    arm.operate("boot")
    with RawClient(arm.command_port) as client:
        assert client.code("get_version") == "0"


def test_every_action_is_answered_while_the_cabinet_is_off_and_one_turns_it_on(make_arm):
    arm = make_arm()
    assert ask_operator_port(arm.operator_port, {"action": "reboot", "down": 600})["ok"]
    for action in sorted(set(ACTIONS) - {"boot"}):
        assert "ok" in ask_operator_port(arm.operator_port, {"action": action, "down": 600}), action
        assert ask_operator_port(arm.operator_port, {"action": "wire"})["wire"]["is_off"], action
    assert ask_operator_port(arm.operator_port, {"action": "boot"})["ok"]
    with RawClient(arm.command_port) as client:
        assert client.code("get_version") == "0"


@pytest.mark.parametrize("rate", [10, 33, 125])
def test_slow_feed_whatever_the_client_asked_for(make_arm, rate):
    arm = make_arm(time_scale=1.0)
    with RawClient(arm.command_port) as client, RawFeed(arm.status_port) as feed:
        assert client.code("set_port10000_delay_ms", port10000_delay_ms=8) == "0"
        arm.operate("slow_feed", rate=rate)
        feed.frame()
        began, frames = arm.state()["simulated_s"], 0
        while arm.state()["simulated_s"] - began < 1.0:
            feed.frame()
            frames += 1
        assert 0.6 * rate < frames < 1.2 * rate + 2
        assert client.ask("get_port10000_delay_ms")["port10000_delay_ms"] == 8


def test_fields_missing_and_extra(arm, feed):
    arm.operate("fields", drop=["inpos", "din"], add={"new": [1, "x"], 'a"b': 1, "\u00e9": 1})
    frame = feed.until(lambda frame: "inpos" not in frame)[-1]
    assert "din" not in frame and frame["new"] == [1, "x"] and frame['a"b'] == frame["\u00e9"] == 1
    arm.operate("clear_faults")
    assert "new" not in feed.until(lambda frame: "inpos" in frame)[-1]


def test_field_switch_of_the_controller_itself(arm, client, feed):
    for value in (0, "1"):
        assert client.code("setOptionalInfoConfig", section="ATTROPTIONALDATA", key="din", value=value) == "0"
        feed.until(lambda frame, value=value: ("din" in frame) == bool(int(value)))
        reply = client.ask("getOptionalInfoConfig", section="ATTROPTIONALDATA", key="din")
        assert reply["value"] == str(value)


@pytest.mark.parametrize("bank, signal, field, index", [
    ("cabinet", "digital", "din", 3), ("tool", "digital", "tio_din", 1), ("cabinet", "analog", "ain", 2),
    ("tool", "analog", "tio_ain", 0)])
def test_inputs(arm, client, feed, bank, signal, field, index):
    arm.operate("set_input", bank=bank, signal=signal, index=index, value=1)
    assert feed.until(lambda frame: frame[field][index] == 1)
    numbers = {"cabinet": 0, "tool": 1}
    assert client.ask("get_%s_input" % signal, type=numbers[bank], index=index)["value"] == 1
    if field == "din":
        assert client.ask("get_digital_input_status")["din_status"][3] == 1


def test_the_force_sensor_is_loaded_where_there_is_one(make_arm):
    with pytest.raises(InvalidCommand, match="no force sensor: start with --force-sensor"):
        make_arm().operate("load_force_sensor", fz=1.0)
    loaded = make_arm(force_sensor=True)
    loaded.operate("load_force_sensor", fx=1.5, mz=-0.25)
    with RawFeed(loaded.status_port) as feed:
        wait_until(lambda: feed.frame()["torqsensor"][1][2] == [1.5, 0, 0, 0, 0, -0.25], "the load is in the feed")
    with pytest.raises(InvalidCommand, match="fy is not a number"):
        loaded.operate("load_force_sensor", fy="much")


def test_drives_are_disabled_at_the_pendant_unless_the_arm_moves(arm, client, feed):
    assert client.code("joint_move", jointPosition=[20.0, 90, -90, 90, 90, 0], speed=10.0) == "0"
    with pytest.raises(InvalidCommand, match="the arm moves"):
        arm.operate("disable")
    client.ask("stop_program")
    wait_until(lambda: not arm.state()["is_moving"], "it rests")
    arm.operate("disable")
    assert feed.until(lambda frame: not frame["enabled"] and frame["powered_on"])


def test_a_program_is_loaded_and_ended_at_the_pendant_whatever_stop_program_does(make_arm):
    arm = make_arm(start="enabled", dialect=Dialect.default("1.5.14").replaced({"stop_ends_program": False}))
    with RawClient(arm.command_port) as client:
        arm.operate("load_program", name="weld")
        assert client.ask("get_loaded_program")["programName"] == "weld"
        client.ask("play_program")
        client.ask("stop_program")
        assert client.ask("get_program_state")["programState"] == "running"
        arm.operate("end_program")
        assert client.ask("get_program_state")["programState"] == "idle"


def test_true_state_and_events(arm, client):
    assert client.code("set_payload", mass=2.5, centroid=[0, 0, 1]) == "0"
    assert client.code("set_digital_output", type=0, index=2, value=1) == "0"
    arm.operate("hit", force=500)
    state = arm.state()
    assert state["payload"]["mass"] == 2.5 and state["digital_outputs"][2] == 1 and state["protective_stop"] is True
    assert state["joint_position"] == [0.0, 90.0, -90.0, 90.0, 90.0, 0.0]
    assert [event["code"] for event in arm.operate("events")["events"]] == ["0xf0034"]


def test_the_same_seed_gives_the_same_faults(make_arm):
    outcomes = []
    for seed in (3, 3, 4):
        arm = make_arm(seed=seed)
        arm.operate("fault", kind="duplicate", port="command", count=None, probability=0.5)
        arm.operate("fault", kind="garbage", port="command", count=None, probability=0.5, bytes=3)
        with RawClient(arm.command_port) as client:
            answered = b""
            for _ in range(12):
                ask_version(client)
                answered += client.socket.recv(65536)
            arm.operate("clear_faults")
            client.send(b'{"cmdName": "is_in_servomove"}')
            while b'"is_in_servomove"' not in answered:  # replies come in order: what is before it is whole
                answered += client.socket.recv(65536)
        outcomes.append(answered)
    assert outcomes[0] == outcomes[1] != outcomes[2] and len(outcomes[0]) > 15 * len(b'{"cmdName": "get_version"}')


def test_actions_over_the_port(arm):
    assert ask_operator_port(arm.operator_port, {"action": "state"})["state"]["is_enabled"] is True
    assert set(ask_operator_port(arm.operator_port, {"action": "help"})["actions"]) == set(ACTIONS)
    answer = ask_operator_port(arm.operator_port, {"action": "dance"})
    assert answer["ok"] is False and "dance" in answer["error"]
    with RawClient(arm.operator_port) as link:
        link.send(b'{"action": "hit", "force": 1}\n{"action": "wire"}')
        assert link.reply() == {"ok": True, "noticed": False}
        assert link.reply()["ok"] is True


@pytest.mark.parametrize("bytes_", [
    b"nan\n", b'POST / HTTP/1.1\r\nHost: x\r\nContent-Length: 34\r\n\r\n{"action": "press_emergency_stop"}',
    b'{"action": "wire"} x {"action": "press_emergency_stop"}'], ids=["a bare word", "a web page", "between requests"])
def test_the_port_closes_at_once_on_what_is_not_its_protocol(arm, bytes_):
    with RawClient(arm.operator_port) as link:
        link.send(bytes_)
        reply = link.reply()
        if reply["ok"]:
            reply = link.reply()
        assert reply["ok"] is False and "JSON objects only" in reply["error"]
        assert link.is_closed()
    assert arm.state()["emergency_stop"] is False


def test_a_port_that_is_not_there(make_arm):
    arm = make_arm(operator_port=None)
    assert arm.operator_port is None
    with pytest.raises(ConnectionLost):
        ask_operator_port(arm.status_port, {"action": "state"}, timeout=5.0)


@pytest.mark.parametrize("request_", [
    {"action": "hit", "force": "hard"}, {"action": "hit", "joint": 9}, {"action": "push"},
    {"action": "push", "joint": 0, "velocity": 1}, {"action": "set_input", "index": 500, "value": 1},
    {"action": "set_input", "index": 1, "value": 1, "bank": "attic"}, {"action": "fault"},
    {"action": "fault", "kind": "drop"}, {"action": "fault", "kind": "explode", "port": "command"},
    {"action": "fault", "kind": "drop", "port": "panel"}, {"action": "fault", "kind": "drop", "port": "status", "x": 1},
    {"action": "fault", "kind": ["drop"], "port": "status"},
    {"action": "fault", "kind": "drop", "port": "status", "self": 1},
    {"action": "fault", "kind": "delay", "port": "status", "delay_ms": "long"},
    {"action": "fault", "kind": "delay", "port": "status", "delay_ms": -1},
    {"action": "fault", "kind": "drop", "port": "status", "count": -1},
    {"action": "fault", "kind": "wrong_len", "port": "status", "offset": -1000001},
    {"action": "fault", "kind": "drop", "port": "status", "probability": 2},
    {"action": "fault", "kind": "drop", "port": "status", "command": "jog"},
    {"action": "stall", "port": "attic"}, {"action": "stall", "duration_ms": -1}, {"action": "slow_feed"},
    {"action": "slow_feed", "rate": 0}, {"action": "fields", "drop": "inpos"}, {"action": "fields", "add": [1]},
    {"action": "reboot", "down": -1}, {"action": None}, {}], ids=repr)
def test_bad_requests_to_the_port_are_told_so(arm, request_):
    answer = ask_operator_port(arm.operator_port, request_)
    assert answer["ok"] is False and answer["error"]


def test_the_former_names_are_understood(arm, make_arm):
    assert arm.panel("state")["ok"] and arm.panel_port == arm.operator_port
    assert make_arm(panel_port=None).operator_port is None


def test_actions_in_process_raise(arm):
    with pytest.raises(InvalidCommand, match="explode"):
        arm.operate("fault", kind="explode", port="command")


def test_rules_in_force_are_shown_and_cleared(arm):
    for kind in KINDS:
        arm.operate("fault", kind=kind, port="poll", count=None)
    assert [rule["kind"] for rule in arm.operate("wire")["wire"]["faults"]] == list(KINDS)
    arm.operate("clear_faults")
    with RawClient(arm.poll_port) as status:
        assert zlib.decompress(zlib.compress(poll(status)))
    assert arm.operate("wire")["wire"]["faults"] == []
