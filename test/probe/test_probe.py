"""The command jaka_probe on simulated controllers that it knows nothing of: what it finds, sends, keeps and leaves."""
import contextlib
import dataclasses
import json
import os
import signal
import socket
import subprocess
import threading
import time
from types import SimpleNamespace

import pytest
from command_places import command_of
from probe_bench import MAY_SEND, WAIT, command, facts_in, probe, wrong
from raw_client import RawClient

from jaka_ros_driver.probe import ask as questions
from jaka_ros_driver.probe import command as probe_command
from jaka_ros_driver.probe import report
from jaka_ros_driver.probe.ask import QUESTIONS, UNKNOWN_COMMAND
from jaka_ros_driver.probe.facts import DESCRIBED, Fact, ProbeStage
from jaka_ros_driver.probe.look import KNOWN, OMITTED, HeardFeed, feed_facts
from jaka_ros_driver.probe.recorded import ConnectionLog, KeptConnection, KeptPiece, hidden, without_identity
from jaka_ros_driver.probe.set_same import READ_BACK
from jaka_ros_driver.ros.driver_lock import DriverLock
from jaka_ros_driver.simulation.dialect.table import DIMENSIONS, Dialect
from jaka_ros_driver.state import RobotState
from jaka_ros_driver.wire.log import read_log

FILES = {"probe.json", "probe.txt", "probe.html", "dialect.json", "wire.mcap"}


BEGINNING = {
    "tool": {"id": 2, "offset": [0.0, 0.0, 0.12, 0.0, 0.0, 0.3]},
    "user_frame": {"id": 1, "offset": [0.2, 0.0, 0.0, 0.0, 0.0, 1.0]},
    "payload": {"mass": 1.2345, "centroid": [0.0, 0.01, 0.04]}, "collision_level": 2,
    "terminals": {"cabinet": {"digital_outputs": {"1": 1, "2": 1, "4": 1}}}}
"""Values that a probe finds on a controller, and must leave there."""
VALUES = sorted(READ_BACK - {"get_digital_output"})


@pytest.fixture
def begun(tmp_path):
    path = tmp_path / "beginning.json"
    path.write_text(json.dumps(BEGINNING))
    return "--begin-with", str(path)


def values_of(arm, base):
    """Return all that the stage set may write, as the controller has it."""
    with RawClient(arm.ports["command_port"]) as client:
        found = {name: client.ask(name) for name in VALUES}
        found["outputs"] = [client.ask("get_digital_output", type=0, index=base + place)["value"] for place in range(8)]
    time.sleep(0.3)  # a controller that serves one client sees the end of this one
    return found


@pytest.mark.parametrize("seed, firmware", [(1, "1.5.14"), (38, "1.7.2")])
def test_each_dimension_that_it_can_see_is_found_and_nothing_is_moved_or_left_otherwise(tmp_path, controller, begun,
                                                                                        seed, firmware):
    arm = controller("--dialect-seed", str(seed), "--firmware", firmware, *begun)
    dialect = Dialect.from_seed(seed, firmware)
    before = values_of(arm, dialect.io_index_base)
    done = probe(tmp_path / "out", arm.ports, "--stage", "move", "--output", "3")
    assert done.returncode == 1 and "move: left out, standard input is no terminal" in done.stdout, done.stdout
    assert values_of(arm, dialect.io_index_base) == before
    found = facts_in(tmp_path / "out")
    settled = {DESCRIBED[name].dimension for name, fact in found.items() if fact.value is not None} - {""}
    busy_host = {"feed_period"} - settled
    seen = {row.dimension for row in DESCRIBED.values() if row.stage is not ProbeStage.MOVE} - {""}
    assert settled | busy_host == seen
    assert not busy_host or "irregularly" in found["feed_period"].how
    assert not wrong(found, dialect)
    assert found["user_ids"].value == list(range(2, 16)) and found["tool_ids"].value == [1, *range(3, 16)]
    assert len(found["same_values"].value) == 4, found["same_values"].how
    assert report.firmware_of(found) == firmware
    assert wrong(dict(found, error_code=Fact("neither", "")), dialect), "a wrong fact must be noticed"
    assert set(arm.sent()) == MAY_SEND[ProbeStage.SET]
    assert arm.is_at_rest_throughout()


def test_ctrl_c_while_an_output_is_switched_is_taken_when_it_is_back(tmp_path, controller, begun):
    arm = controller(*begun)
    before = values_of(arm, 0)
    running = subprocess.Popen(command(tmp_path / "out", arm.ports, "--stage", "set", "--output", "3"),
                               stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    with RawClient(arm.ports["command_port"]) as client:
        deadline = time.monotonic() + WAIT
        while client.ask("get_digital_output", type=0, index=3)["value"] == 0:
            assert time.monotonic() < deadline and running.poll() is None
    running.send_signal(signal.SIGINT)
    said, _ = running.communicate(timeout=WAIT)
    assert running.returncode == 130 and "Traceback" not in said, said
    assert values_of(arm, 0) == before and report.read(str(tmp_path / "out" / "probe.json"))["is_whole"] is False
    assert facts_in(tmp_path / "out")["user_frame_key"].value == "either"


def test_a_stage_sends_what_it_says_and_nothing_else(tmp_path, controller):
    looked = controller()
    assert probe(tmp_path / "look", looked.ports, "--stage", "look").returncode == 0
    assert looked.sent() == [] and looked.status_bytes() == 0
    asked = controller()
    done = probe(tmp_path / "ask", asked.ports)
    names = asked.sent()
    assert set(names) == MAY_SEND[ProbeStage.ASK] and asked.status_bytes() == 0
    assert all(name.startswith(("get_", "is_")) for name in {*QUESTIONS, UNKNOWN_COMMAND})
    assert "18 questions that read" in done.stdout, "each stage is told before it begins"


def test_a_twin_made_of_its_report_is_the_same_to_it(tmp_path, controller):
    first, twin = tmp_path / "first", tmp_path / "twin"
    arm = controller("--dialect-seed", "38", "--firmware", "1.7.2", "--reply-delay", "0.03")
    assert probe(first, arm.ports).returncode == 0
    like = controller("--like", str(first / "probe.json"))
    assert probe(twin, like.ports).returncode == 0
    late = [facts_in(folder)["reply_time"].value for folder in (first, twin)]
    assert min(late) >= 0.03 and late[1] < 2.5 * late[0], "its replies come as late"
    compare = [*command_of("jaka_probe"), "diff", str(first / "probe.json")]
    same = subprocess.run([*compare, str(twin / "probe.json")], stdout=subprocess.PIPE, text=True, timeout=WAIT)
    differences = [line for line in same.stdout.splitlines() if "not settled" not in line]  # a busy host has no period
    assert same.returncode == 0 and differences in ([], ["  no difference"])
    other = json.loads((twin / "probe.json").read_text())
    other["facts"]["error_code"]["value"] = "neither"
    (tmp_path / "other.json").write_text(json.dumps(other))
    changed = subprocess.run([*compare, str(tmp_path / "other.json")], stdout=subprocess.PIPE, text=True, timeout=WAIT)
    assert "  type of `errorCode`: " in changed.stdout and "and neither" in changed.stdout


def test_the_files_do_not_name_the_arm_unless_that_is_asked_for(tmp_path, controller):
    arm = controller("--model", "zu12")
    assert probe(tmp_path / "hidden", arm.ports).returncode == 0
    assert {path.name for path in (tmp_path / "hidden").iterdir()} == FILES
    received = wire(tmp_path / "hidden")
    assert b'"robot_name": "xxxx"' in received and b'"robot_id": "x"' in received and b"1.5.14" in received
    assert probe(tmp_path / "kept", arm.ports, "--keep-identity").returncode == 0
    assert b'"robot_name": "zu12"' in wire(tmp_path / "kept")
    again = probe(tmp_path / "kept", arm.ports)
    assert again.returncode == 1 and "has probe.json already" in again.stdout


def wire(folder):
    return b"".join(event.data for event in read_log(str(folder / "wire.mcap")) if getattr(event, "what", "") == "in")


def test_what_names_an_arm_is_hidden_where_pieces_cut_it():
    text = b'{"version": "1.7", "serial_number": "AB\\"12", "robot_id": 7734, "note": "at 10.5.5.100"}'
    for cut in range(len(text) + 1):
        pieces = [KeptPiece(0, False, text[:cut]), KeptPiece(1, True, b"serial"), KeptPiece(2, False, text[cut:])]
        hidden_pieces = without_identity(pieces, "10.5.5.100")
        assert [len(piece.data) for piece in hidden_pieces] == [len(piece.data) for piece in pieces]
        assert hidden_pieces[0].data + hidden_pieces[2].data == (
            b'{"version": "1.7", "serial_number": "xxxxxx", "robot_id": 0000, "note": "at xxxxxxxxxx"}')
    assert hidden(b'{"version": "1"}') == b'{"version": "1"}'


def test_an_arm_that_moves_or_has_a_driver_is_not_asked(tmp_path, controller):
    arm = controller()
    lock = DriverLock("127.0.0.1", arm.ports["command_port"], "node /cell")
    try:
        done = probe(tmp_path / "driven", arm.ports)
    finally:
        lock.release()
    assert done.returncode == 1 and "node /cell (pid %d) has the controller" % os.getpid() in done.stdout
    assert facts_in(tmp_path / "driven")["second_status_client"].value == "coexists"
    with RawClient(arm.ports["command_port"]) as client:
        client.ask("jog", jog_mode=0, coord_map=1, jnum=0, jogvel=5.0, poscmd=0.0)
        client.ask("jog", jog_mode=1, coord_map=1, jnum=0, jogvel=5.0, poscmd=0.0)
        done = probe(tmp_path / "moving", arm.ports)
        assert done.returncode == 1 and "the arm moves" in done.stdout, done.stdout
    assert not set(arm.sent()) & (set(QUESTIONS) - {"get_version"})


def heard(*ages, at=(0.0,) * 6):
    """Return a feed with states of these ages, s, the last of which is at other joints where they are given."""
    feed = HeardFeed(SimpleNamespace(is_closed=True))
    feed.states = [RobotState((0.0,) * 6, *([True] * 3), False, False, received_at=time.monotonic() - age)
                   for age in ages]
    feed.states[-1] = dataclasses.replace(feed.states[-1], joint_position=at)
    return feed


@pytest.mark.parametrize("feed, reason", [
    (lambda: heard(20.03, 20.0), "no frame came"), (lambda: heard(0.06, 0.03), ""),
    (lambda: heard(0.06, 0.03, at=(0.1,) * 6), "the arm moves"), (lambda: heard(0.0), "does not show"),
    (lambda: None, "does not show")])
def test_a_feed_that_is_silent_does_not_show_an_arm_at_rest(tmp_path, feed, reason):
    run = probe_command._Run(probe_command.parser().parse_args(["10.0.0.1", "--out", str(tmp_path)]))
    found = run._refusal(feed())
    assert reason in found and bool(reason) == bool(found)


def test_frames_that_waited_to_be_read_are_old_before_anything_is_asked(tmp_path, monkeypatch):
    ours, theirs = socket.socketpair()
    text = b""
    for _ in range(3):
        text = json.dumps({"len": len(text), "joint_actual_position": [0.0] * 6, "enabled": True, "powered_on": 1,
                           "inpos": True, "emergency_stop": 0, "protective_stop": 0}).encode()
    with ours, theirs:
        theirs.sendall(3 * text)
        feed = HeardFeed(KeptConnection(ConnectionLog(""), "status", ours))
        run = probe_command._Run(probe_command.parser().parse_args(["10.0.0.1", "--out", str(tmp_path)]))
        monkeypatch.setattr(run, "_look", lambda: feed)
        monkeypatch.setattr(run, "_ask", lambda feed: pytest.fail("it was asked"))
        assert run.stages() == 1 and len(feed.states) == 3


def test_no_other_connection_is_made_while_somebody_moves_the_arm(monkeypatch):
    feed, made = heard(0.06, 0.03), []

    class Record:
        def connect(self, port, number):
            made.append(port)
            feed.states = heard(0.06, 0.0, at=(0.1,) * 6).states
            return SimpleNamespace(is_closed=True, close=lambda: None, receive=lambda deadline: b"")
    monkeypatch.setattr(questions, "_SHORT_S", 0.01)
    facts = {}
    questions.ask(Record(), facts, 1, feed, lambda line: None)
    assert made == ["command"]
    assert "the arm moves" in facts["second_client"].how and "the arm moves" in facts["malformed"].how
    assert facts["second_client"].value is facts["malformed"].value is None


def test_ctrl_c_leaves_a_whole_report(tmp_path, controller):
    arm = controller()
    running = subprocess.Popen(command(tmp_path / "out", arm.ports, "--seconds", "600"), stdout=subprocess.PIPE,
                               stderr=subprocess.STDOUT, text=True)
    assert "nothing is sent" in running.stdout.readline()
    time.sleep(1.5)  # some frames
    running.send_signal(signal.SIGINT)
    said, _ = running.communicate(timeout=WAIT)
    assert running.returncode == 130 and "Traceback" not in said, said
    assert {path.name for path in (tmp_path / "out").iterdir()} == FILES
    assert report.read(str(tmp_path / "out" / "probe.json"))["is_whole"] is False
    assert facts_in(tmp_path / "out")["frame_bytes"].value > 1000


@pytest.mark.parametrize("behaviour", [b"", b"garbage " * 100, b'{"len": 60000, ', b"hang up"])
def test_what_is_no_controller_is_told_and_takes_no_longer(tmp_path, behaviour):
    with contextlib.ExitStack() as stack:
        server = stack.enter_context(socket.create_server(("127.0.0.1", 0)))
        held = []

        def serve():
            with contextlib.suppress(OSError):
                while True:
                    connection, _ = server.accept()
                    if behaviour == b"hang up":
                        connection.close()
                        continue
                    held.append(stack.enter_context(connection))
                    connection.sendall(behaviour)
        threading.Thread(target=serve, daemon=True).start()
        port = server.getsockname()[1]
        done = probe(tmp_path / "out", {"command_port": port, "status_port": port, "poll_port": 1})
        server.shutdown(socket.SHUT_RDWR)
    assert done.returncode == 1 and "does not show whether the arm moves" in done.stdout, done.stdout
    found = facts_in(tmp_path / "out")
    assert found["feed_period"].value is None and found["polled_port"].value == "closed"


def test_nobody_there_is_told_with_the_port(tmp_path):
    done = probe(tmp_path / "out", {"command_port": 1, "status_port": 2, "poll_port": 3})
    assert done.returncode == 1 and "the status port 2: [Errno 111] Connection refused" in done.stdout
    named = subprocess.run(command(tmp_path / "no", {"command_port": 1, "status_port": 2, "poll_port": 3},
                                   address="no.such.host.invalid"), stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                           text=True, timeout=WAIT)
    assert named.returncode == 1 and "Traceback" not in named.stdout


@pytest.mark.parametrize("text", ["", "[]", "{", '{"format": 2}', '{"format": 1, "facts": {"model": 3}}', "[" * 5000])
def test_a_report_that_is_none_is_refused(tmp_path, text):
    path = tmp_path / "probe.json"
    path.write_text(text)
    done = subprocess.run([*command_of("jaka_probe"), "explain", str(path)], capture_output=True, text=True,
                          timeout=WAIT)
    assert done.returncode == 1 and done.stderr.startswith("jaka_probe: error: ") and "Traceback" not in done.stderr


@pytest.mark.parametrize("name, value", [
    ("feed_period", "x"), ("feed_period", True), ("feed_period", float("nan")), ("start_delay", [1]),
    ("reply_time", 10 ** 400), ("commands_missing", 3), ("commands_missing", [[1]]), ("frame_fields_unknown", "all"),
    ("twin_angle", "x"), ("io_index_base", [0]), ("stop_ends_jog", "yes"), ("error_code", {})])
def test_a_fact_of_another_kind_is_refused_with_its_name(tmp_path, capsys, name, value):
    facts = {name: {"value": value, "how": "x"}, "twin_time": {"value": 0.1, "how": "x"},
             "version": {"value": "1.7.2", "how": "x"}}
    path = tmp_path / "probe.json"
    path.write_text(json.dumps({"format": 1, "facts": facts}))
    for words in (["explain", str(path)], ["diff", str(path), str(path)]):
        assert probe_command.main(words) == 1
        said = capsys.readouterr().err
        assert said.startswith("jaka_probe: error: ") and name in said and said.count("\n") == 1


@pytest.mark.parametrize("value", [10 ** 400, float("inf"), -1, True, "1" * 5000, None])
def test_a_period_that_is_none_is_not_settled(value):
    assert questions._told_period(value).value is None
    assert questions._told_period(8).value == questions._told_period("8").value == 0.008


def test_wrong_usage_has_code_2(tmp_path):
    for words in (["10.0.0.1"], ["explain"], ["diff", "a"], ["10.0.0.1", "x", "--out", "y"],
                  ["10.0.0.1", "--out", "y", "--seconds", "0"], ["10.0.0.1", "--out", "y", "--stage", "jump"],
                  ["10.0.0.1", "--out", "y", "--output", "3"],
                  ["10.0.0.1", "--out", "y", "--stage", "set", "--output", "0"]):
        done = subprocess.run([*command_of("jaka_probe"), *words], stderr=subprocess.PIPE, text=True, timeout=WAIT,
                              cwd=str(tmp_path))
        assert done.returncode == 2 and "usage: jaka_probe" in done.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("gaps, is_settled", [([0.03] * 40, True), ([0.0, 0.0, 0.0, 0.12] * 10, False),
                                              ([0.0079, 0.0081, 0.0075] * 20, True), ([0.001, 0.2] * 20, False)])
def test_a_period_is_told_of_a_regular_feed_alone(gaps, is_settled):
    feed = HeardFeed(None)
    feed.times = [100.0 + sum(gaps[:count]) for count in range(len(gaps) + 1)]
    feed.lengths = [3208] * len(feed.times)
    found = feed_facts(feed, sum(gaps))["feed_period"]
    assert (found.value is not None) is is_settled
    assert found.value == pytest.approx(sum(gaps) / len(gaps), abs=1e-5) if is_settled else "irregularly" in found.how


@pytest.mark.parametrize("second", ['"x"', "null", "1.5", "true", "[1]", "1" + 400 * "0"])
def test_a_frame_whose_len_is_no_whole_number_is_damaged(second):
    ours, theirs = socket.socketpair()
    with ours, theirs:
        feed = HeardFeed(KeptConnection(ConnectionLog(""), "status", ours))
        rest = ', "enabled": true, "len": %s}' % second
        text = '{"len": %d%s' % (len('{"len": 99') + len(rest), rest)
        text = '{"len": %d%s' % (len(text), rest)
        theirs.sendall(text.encode())
        feed.read()
    assert (feed.damaged, feed.lengths, feed.states) == (1, [], [])
    assert feed_facts(feed, 1.0)["feed_period"].value is None


def test_names_of_dimensions_and_fields_are_those_of_the_simulated_controller():
    assert {row.dimension for row in DESCRIBED.values()} - {""} <= set(DIMENSIONS)
    assert OMITTED and OMITTED < KNOWN
