"""The command jaka_doctor on computers that are broken on purpose: its findings, and what it never sends."""
import contextlib
import json
import os
import re
import socket
import subprocess
import tarfile
import threading
import time

import pytest
import waiting
from command_parsers import parser
from command_places import command_of
from driver_bench import DriverProcess, SimulatorProcess, on
from ros_graph import Graph
from waiting import eventually
from wire_verdict import WireVerdict

from jaka_ros_driver.doctor import bundle, command, computer
from jaka_ros_driver.doctor.findings import Examination, Level
from jaka_ros_driver.doctor.questions import QUESTIONS, FeedSample
from jaka_ros_driver.doctor.subject import ExaminedSystem
from jaka_ros_driver.protocol.codec import command_name
from jaka_ros_driver.state import RobotState

LONGEST_S = 120
READS = {command_name(query) for query in QUESTIONS}


@pytest.fixture(scope="module")
def graph(tmp_path_factory):
    with Graph(tmp_path_factory.mktemp("doctor")) as graph:
        yield graph


@pytest.fixture(scope="module")
def simulator(tmp_path_factory):
    with contextlib.closing(SimulatorProcess("--start", "enabled")) as process:
        yield process


def at(simulator, **parameters):
    given = dict({"ip": "127.0.0.1", "model": "zu7", "command_port": simulator.command_port,
                  "status_port": simulator.status_port}, **parameters)
    return ["%s:=%s" % item for item in given.items()]


def run(graph, *words, before=(), **variables):
    environment = {name: value for name, value in dict(graph.environment, **variables).items() if value is not None}
    done = subprocess.run([*before, *command_of("jaka_doctor"), *words], env=environment, cwd=str(graph.folder),
                          stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=LONGEST_S)
    assert "Traceback" not in done.stdout + done.stderr, done.stdout + done.stderr
    return done


def report(graph, *words, **options):
    """Return exit code and findings by check; every finding is whole."""
    done = run(graph, "--json", *words, **options)
    said = json.loads(done.stdout)
    found = {row["check"]: row for row in said["checks"]}
    assert len(found) == len(said["checks"]) and all(all(row.values()) for row in said["checks"]), said
    assert not [row for row in said["checks"] if "this check failed" in row["meaning"]], said
    assert said["faults"] == len(faults(found)) and done.returncode == bool(said["faults"])
    return done.returncode, found


def faults(found):
    return {name for name, row in found.items() if row["level"] == "fault"}


# ---- a computer on which all is well ----

def test_all_is_well_before_a_driver_starts(graph, simulator):
    code, found = report(graph, *at(simulator))
    assert code == 0 and not faults(found), found
    of_the_host = ("clock", "disk for a recorder", "status feed")
    levels = {name: row["level"] for name, row in found.items() if name not in of_the_host}
    assert set(levels.values()) == {"ok"}, levels
    assert "0.0 mm" in found["model"]["found"] and " 0 damaged, " in found["status feed"]["found"]


def test_each_line_says_what_and_found_and_what_is_wrong_meaning_and_remedy(graph, simulator):
    done = run(graph, *at(simulator, model="zu12"))
    assert done.returncode == 1
    lines = done.stdout.splitlines()
    wrong = next(number for number, line in enumerate(lines) if re.match("fault +model: model zu12: the tool", line))
    assert lines[wrong + 1].lstrip().startswith("meaning: limits and paths are computed for another arm")
    assert lines[wrong + 2].lstrip().startswith("remedy: set model to this arm")
    assert re.fullmatch(r"2\d checks: \d+ well, 0 skipped, \d warnings, 1 faults", lines[-1])


def test_nothing_is_sent_but_what_the_driver_asks_at_its_start(graph, tmp_path):
    log = tmp_path / "wire.mcap"
    with contextlib.closing(SimulatorProcess("--log", str(log))) as simulator:
        report(graph, *at(simulator))
        before = simulator.state()
        assert not before["is_powered"] and not before["is_enabled"]
    sent = [request["cmdName"] for _, request in WireVerdict(log).received()]
    assert sorted(sent) == sorted(READS)
    assert all(re.match("get_|is_", name) for name in READS)


def test_the_questions_are_some_of_those_that_a_driver_asks_at_its_start(ros_node, tmp_path):
    log = tmp_path / "wire.mcap"
    with contextlib.closing(SimulatorProcess("--log", str(log))) as simulator, \
            DriverProcess("asking", **on(simulator, guard=False)) as driver:
        next(line for line in driver.process.stdout if "driving a JAKA" in line)

        def asked():
            return {request["cmdName"] for _, request in WireVerdict(log).received()}
        assert eventually(lambda: asked() >= READS), asked()


# ---- beside a driver, and beside others ----

def test_a_controller_that_a_driver_has_is_not_connected(ros_node, tmp_path):
    environment = type("Environment", (), {"environment": dict(os.environ), "folder": tmp_path})
    with contextlib.closing(SimulatorProcess("--start", "enabled", "--single-client", "replace")) as simulator, \
            DriverProcess("driving", **on(simulator, guard=False)) as driver:
        next(line for line in driver.process.stdout if "driving a JAKA" in line)
        assert eventually(lambda: simulator.operate("wire"))
        before = simulator.operate("wire")["wire"]
        code, found = report(environment, "--node", "/driving")
        assert code == 0, found
        assert "parameters of /driving" in found["parameters"]["found"]
        assert "node /driving" in found["other driver"]["found"]
        assert found["command port"]["found"].startswith("left alone: node /driving")
        assert found["model"]["level"] == "skipped"
        assert "runs already" in found["node name"]["found"]
        assert simulator.operate("wire")["wire"].keys() == before.keys()


def test_the_command_port_is_left_alone_while_the_arm_moves(graph):
    with contextlib.closing(SimulatorProcess("--start", "enabled")) as simulator:
        with socket.create_connection(("127.0.0.1", simulator.command_port)) as other:
            other.sendall(json.dumps({"cmdName": "joint_move", "relFlag": 1, "speed": 2, "accel": 50, "jointPosition": [
                90, 0, 0, 0, 0, 0]}).encode())
            assert eventually(simulator.is_moving)
            _, found = report(graph, *at(simulator))
            assert simulator.is_moving()
    assert found["command port"]["found"] == "left alone: the arm moves"
    assert found["command port"]["level"] == found["firmware"]["level"] == "skipped"


def test_the_command_port_is_left_alone_where_that_is_asked_for(graph, simulator):
    _, found = report(graph, "--status-only", *at(simulator))
    assert found["command port"]["found"] == "left alone: --status-only was given"
    assert " 0 damaged, " in found["status feed"]["found"]


def test_another_client_is_found(graph):
    with contextlib.closing(SimulatorProcess("--start", "enabled", "--single-client", "refuse")) as simulator, \
            socket.create_connection(("127.0.0.1", simulator.command_port)) as other:
        other.sendall(b'{"cmdName": "get_version"}')
        assert other.recv(4096)
        code, found = report(graph, *at(simulator))
    assert code == 1 and faults(found) == {"command port"}, found
    assert "another client has the controller" in found["command port"]["meaning"]


# ---- broken networks ----

@contextlib.contextmanager
def silent_port():
    """Yield a port that drops what comes, as a firewall does: a queue of connections that is full."""
    with socket.socket() as listening, contextlib.ExitStack() as waiting_ones:
        listening.bind(("127.0.0.1", 0))
        listening.listen(0)
        for _ in range(4):
            one = waiting_ones.enter_context(socket.socket())
            one.setblocking(False)
            with contextlib.suppress(BlockingIOError):
                one.connect(listening.getsockname())
        yield listening.getsockname()[1]


def test_a_master_that_is_not_there_is_told_from_one_that_is_cut_off(graph):
    (closed,) = waiting.free_ports(1)
    _, found = report(graph, ROS_MASTER_URI="http://127.0.0.1:%d" % closed)
    assert faults(found) == {"ROS master"} and "connection refused" in found["ROS master"]["found"]
    assert {found[name]["level"] for name in ("way back", "ROS time", "node name")} == {"skipped"}
    with silent_port() as port:
        _, found = report(graph, ROS_MASTER_URI="http://127.0.0.1:%d" % port)
    assert faults(found) == {"ROS master"} and "no answer in 3 s" in found["ROS master"]["found"]
    assert "firewall" in found["ROS master"]["remedy"]


def test_a_controller_that_refuses_is_told_from_one_that_is_cut_off(graph):
    ports = waiting.free_ports(2)
    code, found = report(graph, "ip:=127.0.0.1", "command_port:=%d" % ports[0], "status_port:=%d" % ports[1])
    assert code == 1 and faults(found) == {"status port"} and "connection refused" in found["status port"]["found"]
    with silent_port() as port:
        _, found = report(graph, "ip:=127.0.0.1", "status_port:=%d" % port)
    assert faults(found) == {"status port"} and "firewall" in found["status port"]["meaning"]
    assert found["command port"]["level"] == "skipped", "whether the arm moves is not known"


@pytest.mark.parametrize("name, value", [("ROS_HOSTNAME", "nobody.invalid"), ("ROS_IP", "192.0.2.7")])
def test_an_address_of_another_computer_is_found_from_both_sides(graph, name, value):
    variables = dict({"ROS_IP": None, "ROS_HOSTNAME": None}, **{name: value})
    _, found = report(graph, **variables)
    assert faults(found) == {"own address", "way back"}, found
    assert "the address comes from %s=%s" % (name, value) in found["own address"]["found"]
    assert "exit code 4" in found["own address"]["meaning"]


def test_both_variables_are_a_warning_and_a_master_without_a_port_is_a_fault(graph):
    _, found = report(graph, ROS_IP="127.0.0.1", ROS_HOSTNAME="localhost")
    assert found["ROS variables"]["level"] == "warning" and not faults(found)
    _, found = report(graph, ROS_MASTER_URI="master:11311")
    assert "ROS variables" in faults(found)


@pytest.mark.skipif(os.getuid() != 0, reason="a network of its own needs root")
def test_a_computer_without_any_network(graph):
    _, found = report(graph, "ip:=10.5.5.100", before=("unshare", "--net"))
    assert {"own address", "ROS master", "way to the controller", "status port"} <= faults(found)
    assert "unreachable" in found["way to the controller"]["found"]


@pytest.mark.skipif(os.getuid() != 0, reason="a network of its own needs root")
def test_a_controller_in_a_network_that_the_computer_is_not_in(graph):
    here = 'ip link set lo up && ip addr add 192.168.7.2/32 dev lo && exec "$@"'
    _, found = report(graph, "ip:=10.5.5.100", before=("unshare", "--net", "sh", "-c", here, "sh"))
    assert "way to the controller" in faults(found)
    assert "give this computer an address in the controller's network" in found["way to the controller"]["remedy"]


# ---- broken controllers and configurations ----

def test_another_arm_than_the_model(graph, simulator):
    _, found = report(graph, *at(simulator, model="zu12"))
    assert faults(found) == {"model"} and "dh_file" in found["model"]["remedy"]


def test_the_command_port_in_place_of_the_status_port(graph, simulator):
    _, found = report(graph, *at(simulator, status_port=simulator.command_port, command_port=simulator.status_port))
    assert faults(found) == {"status feed"} and "moves nothing without states" in found["status feed"]["meaning"]


def test_a_feed_that_is_no_feed(graph):
    with socket.socket() as listening:
        listening.bind(("127.0.0.1", 0))
        listening.listen()

        def chatter():
            with contextlib.suppress(OSError):
                connection, _ = listening.accept()
                with connection:
                    for _ in range(200):
                        connection.sendall(b'{"len": 20, "a": "b"} nonsense ')
                        time.sleep(0.01)  # the rate of a feed
        thread = threading.Thread(target=chatter)
        thread.start()
        _, found = report(graph, "ip:=127.0.0.1", "status_port:=%d" % listening.getsockname()[1])
        thread.join()
    assert faults(found) == {"status feed"} and "no status feed that the driver understands" in found[
        "status feed"]["meaning"]


def test_a_command_port_that_does_not_answer(graph, simulator):
    with socket.socket() as listening:
        listening.bind(("127.0.0.1", 0))
        listening.listen()
        _, found = report(graph, *at(simulator, command_port=listening.getsockname()[1]))
    assert faults(found) == {"command port"} and "not even a stop" in found["command port"]["meaning"]
    assert found["model"]["level"] == "skipped"


def test_parameters_that_the_driver_refuses_are_named_and_the_rest_is_looked_at(graph, simulator):
    code, found = report(graph, *at(simulator, model="foo", publish_rat="125"))
    assert code == 1 and faults(found) == {"parameters"}
    assert "did you mean ~publish_rate?" in found["parameters"]["found"] and "'foo'" in found["parameters"]["found"]
    assert found["firmware"]["level"] == "ok" and found["model"]["level"] == "skipped"


def test_time_that_stands_still(graph):
    graph.master().setParam("/use_sim_time", True)
    try:
        _, found = report(graph)
        assert faults(found) == {"ROS time"} and "nobody publishes /clock" in found["ROS time"]["found"]
    finally:
        graph.master().deleteParam("/use_sim_time")


# ---- broken disks ----

def test_folders_that_take_no_file(graph, simulator):
    _, found = report(graph, *at(simulator, audit_dir="/proc/audit"), ROS_LOG_DIR="/proc/self")
    assert faults(found) == {"log folder", "audit log folder", "disk for a recorder"}, found
    assert "ROS_LOG_DIR" in found["log folder"]["remedy"]


@pytest.mark.skipif(os.getuid() != 0, reason="a disk of its own needs root")
def test_a_disk_that_is_nearly_full(graph, tmp_path):
    mounted = 'mount -t tmpfs -o size=40m tmpfs "$0" && exec "$@"'
    code, found = report(graph, before=("unshare", "--mount", "sh", "-c", mounted, str(tmp_path)),
                         ROS_LOG_DIR=str(tmp_path / "log"))
    assert code == 1 and faults(found) == {"log folder"} and "make room" in found["log folder"]["remedy"]


def test_nothing_is_left_in_the_folders(graph, tmp_path):
    report(graph, "audit_dir:=%s" % (tmp_path / "audit"), ROS_LOG_DIR=str(tmp_path / "log"),
           XDG_RUNTIME_DIR=str(tmp_path))
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == []


# ---- parts ----

def subject(**values):
    return ExaminedSystem(values, "test", "/jaka_driver")


@pytest.mark.parametrize("age, reason", [(0.1, None), (3.0, "no frame came")])
def test_a_feed_that_fell_silent_shows_no_arm_at_rest(age, reason):
    one = subject(ip="127.0.0.1")
    now = time.monotonic()
    states = [RobotState((0.0,) * 6, *([True] * 3), False, False, received_at=now - age)] * 2
    one.holder, one.feed = "", FeedSample(None, states, 0, {}, 1.5, False, now)
    assert one.refusal is None if reason is None else reason in one.refusal.reason


def test_a_clock_that_was_set_back():
    assert computer.clock(subject(), now=0.0).level is Level.FAULT
    assert computer.clock(subject(), now=time.time()).level is not Level.FAULT


def test_a_package_that_is_not_there(monkeypatch):
    monkeypatch.setattr(computer, "PACKAGES", ("json", "jaka_no_such_package"))
    found = computer.python(subject())
    assert found.level is Level.FAULT and "not there: jaka_no_such_package" in found.found


def test_a_slow_disk(monkeypatch):
    monkeypatch.setattr(computer, "_measured", lambda folder: (1.5, 0.2))
    assert computer.disk_speed(subject()).level is Level.WARNING
    monkeypatch.setattr(computer, "_measured", lambda folder: (50.0, 1.2))
    assert computer.disk_speed(subject()).level is Level.WARNING


def test_a_check_that_fails_costs_its_own_row_only():
    row = command.examined(Examination("broken", lambda subject: 1 / 0), subject())
    assert row.finding.level is Level.FAULT and row.finding.found == "ZeroDivisionError: division by zero"


@pytest.mark.parametrize("word", ["10.5.5.100", "ip=10.5.5.100", ":=1", "--no-such-option"])
def test_words_that_are_not_understood(graph, word):
    done = run(graph, word)
    assert done.returncode == 2 and "usage: jaka_doctor" in done.stderr


def test_the_help_says_what_is_never_sent():
    said = " ".join(parser("jaka_doctor", []).format_help().split())
    assert "Nothing is sent to a controller that moves, sets or powers anything" in said


# ---- the bundle ----

SECRETS = ("hunter2", "s3cr3t", "abcdef0123", "MIIEvQ", "tr0ub4dor")


def test_the_bundle_has_what_a_bug_report_needs_and_no_secrets(graph, simulator, tmp_path):
    log = tmp_path / "log"
    log.mkdir()
    (log / "jaka_driver-1.log").write_text(
        "driving a JAKA zu7\npage at http://cell:8080/#token=abcdef0123\npassword: tr0ub4dor\n"
        "-----BEGIN PRIVATE KEY-----\nMIIEvQ\n-----END PRIVATE KEY-----\nthe end\n")
    graph.master().setParam("/jaka_driver", {"model": "zu7", "api_token": "s3cr3t"})
    path = tmp_path / "report.tar.gz"
    try:
        done = run(graph, *at(simulator), "--bundle", str(path), ROS_LOG_DIR=str(log), PANEL_TOKEN="hunter2",
                   ROS_MASTER_URI=graph.uri.replace("http://", "http://me:hunter2@"))
    finally:
        graph.master().deleteParam("/jaka_driver")
    assert "report.tar.gz holds report.txt, report.json, parameters.yaml" in done.stderr
    assert path.stat().st_mode & 0o077 == 0
    with tarfile.open(path) as archive:
        texts = {member.name: archive.extractfile(member).read().decode() for member in archive}
    assert {name.split("/")[-1] for name in texts} == {
        "report.txt", "report.json", "parameters.yaml", "environment.txt", "system.txt", "status_frame.json",
        "driver.log"}
    assert not [(name, secret) for name, text in texts.items() for secret in SECRETS if secret in text]
    assert "the end" in texts["jaka_doctor/driver.log"] and "driving a JAKA" in texts["jaka_doctor/driver.log"]
    assert json.loads(texts["jaka_doctor/report.json"])["checks"]
    assert "joint_actual_position" in json.loads(texts["jaka_doctor/status_frame.json"])


def test_a_bundle_overwrites_nothing_and_says_what_it_cannot_write(graph, tmp_path):
    path = tmp_path / "report.tar.gz"
    path.write_text("mine")
    done = run(graph, "--bundle", str(path))
    assert done.returncode == 1 and "File exists" in done.stderr and path.read_text() == "mine"
    done = run(graph, "--bundle", str(tmp_path / "no" / "report.tar.gz"))
    assert done.returncode == 1 and "No such file" in done.stderr


@pytest.mark.parametrize("text", ["the key 3 was pressed", "~command_port: 10001", "model zu7 at http://cell:11311/"])
def test_what_is_no_secret_stays(text):
    assert bundle.without_secrets(text) == text
