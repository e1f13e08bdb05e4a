"""The program jaka_probe on simulated controllers that it knows nothing of: what it finds, sends, keeps and leaves."""
import contextlib
import json
import os
import signal
import socket
import subprocess
import threading
import time

import pytest
from program_places import command_of
from raw_client import RawClient

from jaka_ros_driver.probe import report
from jaka_ros_driver.probe.ask import MALFORMED, QUESTIONS, UNKNOWN_COMMAND
from jaka_ros_driver.probe.facts import DESCRIBED, Fact
from jaka_ros_driver.probe.look import KNOWN, OMITTED, HeardFeed, feed_facts
from jaka_ros_driver.probe.recorded import KeptPiece, hidden, without_identity
from jaka_ros_driver.protocol.framing import ObjectStream
from jaka_ros_driver.ros.driver_lock import DriverLock
from jaka_ros_driver.simulation.dialect.table import DIMENSIONS, Dialect
from jaka_ros_driver.wire.log import read_log

WAIT = 60.0
FILES = {"probe.json", "probe.txt", "dialect.json", "wire.mcap"}


class Controller:
    """The executable jaka_sim on free ports, with a log of all that it is sent."""

    def __init__(self, folder, *arguments):
        self.log = folder / ("sent-%d.mcap" % time.monotonic_ns())
        self.process = subprocess.Popen(
            [*command_of("jaka_sim"), "--command-port", "0", "--status-port", "0", "--poll-port", "0", "--start",
             "enabled", "--log", str(self.log), *arguments],
            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        self.ports = json.loads(self.process.stdout.readline())

    def close(self):
        self.process.terminate()
        self.process.communicate(timeout=WAIT)

    def sent(self):
        """Return the names of the commands that it was sent, and the pieces that hold none."""
        self.close()
        names, stream = [], ObjectStream()
        for event in read_log(str(self.log)):
            if getattr(event, "port", "") == "command" and event.what == "in":
                if event.data == MALFORMED:
                    names.append("malformed")
                    continue
                names += [item["cmdName"] for item in stream.feed(event.data)]
        return names

    def status_bytes(self):
        return sum(len(event.data) for event in read_log(str(self.log))
                   if getattr(event, "port", "") in ("status", "poll") and event.what == "in")


@pytest.fixture
def controller(tmp_path):
    with contextlib.ExitStack() as stack:
        def start(*arguments):
            return stack.enter_context(contextlib.closing(Controller(tmp_path, *arguments)))
        yield start


def command(folder, ports, *arguments, address="127.0.0.1"):
    return [*command_of("jaka_probe"), address, "--out", str(folder), "--seconds", "1.5",
            *(word for name in ("command", "status", "poll")
              for word in ("--%s-port" % name, str(ports[name + "_port"]))), *arguments]


def probe(folder, ports, *arguments):
    done = subprocess.run(command(folder, ports, *arguments), stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          text=True, timeout=WAIT)
    assert "Traceback" not in done.stdout, done.stdout
    return done


def facts_in(folder):
    return report.facts_of(report.read(str(folder / "probe.json")))


def wrong(found, dialect):
    """Return which dimensions a report has otherwise than they are."""
    rows = []
    for name, described in DESCRIBED.items():
        key = described.dimension
        true = getattr(dialect, key) if key else None
        if not key or name not in found or found[name].value is None:
            continue
        value = report.dialect_of(found)[key]
        if key == "feed_period":
            is_right = abs(value - max(true, dialect.shortest_feed_period)) < 0.002 + 0.1 * true
        elif key == "frame_bytes":
            is_right = abs(value - true) < 20 or true < value < 7000  # as long as its fields are
        elif key == "unknown_frame_fields":
            is_right = value == (true or "vendor_block" in found[name].value)  # what fills frames up is unknown, too
        elif key == "missing_commands":
            is_right = set(value) == set(true) & set(QUESTIONS)
        else:
            is_right = value == (sorted(true, key=DIMENSIONS[key].names.index) if isinstance(true, tuple) else true)
        rows += [] if is_right else [(key, value, true)]
    return rows


@pytest.mark.parametrize("seed, firmware", [(1, "1.5.14"), (5, "1.7.1"), (38, "1.7.2")])
def test_each_dimension_that_it_can_see_is_found_on_a_controller_it_knows_nothing_of(tmp_path, controller, seed,
                                                                                     firmware):
    arm = controller("--dialect-seed", str(seed), "--firmware", firmware)
    done = probe(tmp_path / "out", arm.ports)
    assert done.returncode == 0, done.stdout
    found, dialect = facts_in(tmp_path / "out"), Dialect.from_seed(seed, firmware)
    settled = {DESCRIBED[name].dimension for name, fact in found.items() if fact.value is not None} - {""}
    busy_host = {"feed_period"} - settled
    assert settled | busy_host == {row.dimension for row in DESCRIBED.values()} - {""}
    assert not busy_host or "irregularly" in found["feed_period"].how
    assert not wrong(found, dialect)
    assert report.firmware_of(found) == firmware
    assert wrong(dict(found, error_code=Fact("neither", "")), dialect), "a wrong fact must be noticed"


def test_a_stage_sends_what_it_says_and_nothing_else(tmp_path, controller):
    looked = controller()
    assert probe(tmp_path / "look", looked.ports, "--stage", "look").returncode == 0
    assert looked.sent() == [] and looked.status_bytes() == 0
    asked = controller()
    done = probe(tmp_path / "ask", asked.ports)
    names = asked.sent()
    assert set(names) == {*QUESTIONS, UNKNOWN_COMMAND, "malformed"} and asked.status_bytes() == 0
    assert all(name.startswith(("get_", "is_")) for name in {*QUESTIONS, UNKNOWN_COMMAND})
    assert "18 questions that read" in done.stdout, "each stage is told before it begins"


def test_a_twin_made_of_its_report_is_the_same_to_it(tmp_path, controller):
    first, twin = tmp_path / "first", tmp_path / "twin"
    assert probe(first, controller("--dialect-seed", "38", "--firmware", "1.7.2").ports).returncode == 0
    like = controller("--dialect", str(first / "dialect.json"), "--firmware", "1.7.2")
    assert probe(twin, like.ports).returncode == 0
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


def test_wrong_usage_has_code_2(tmp_path):
    for words in (["10.0.0.1"], ["explain"], ["diff", "a"], ["10.0.0.1", "x", "--out", "y"],
                  ["10.0.0.1", "--out", "y", "--seconds", "0"], ["10.0.0.1", "--out", "y", "--stage", "move"]):
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


def test_names_of_dimensions_and_fields_are_those_of_the_simulated_controller():
    assert {row.dimension for row in DESCRIBED.values()} - {""} <= set(DIMENSIONS)
    assert OMITTED and OMITTED < KNOWN
