"""The executable as users start it."""
import json
import re
import signal
import subprocess

import pytest
from command_places import command_of
from raw_client import RawClient, RawFeed

from jaka_ros_driver.simulation.__main__ import main
from jaka_ros_driver.simulation.dialect.table import Dialect
from jaka_ros_driver.wire.log import read_log

PROGRAM = command_of("jaka_sim")
FREE = ["--command-port", "0", "--status-port", "0", "--poll-port", "0"]


@pytest.fixture
def start():
    programs = []

    def run(*arguments):
        program = subprocess.Popen([*PROGRAM, *FREE, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                   text=True)
        programs.append(program)
        return program, json.loads(program.stdout.readline())

    yield run
    for program in programs:
        if program.poll() is None:
            program.kill()
        program.communicate()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_first_line_names_the_ports_and_a_signal_ends_it_cleanly(start, number):
    program, ports = start("--start", "enabled", "--time-scale", "10", "--model", "zu12")
    assert set(ports) == {"command_port", "status_port", "poll_port", "panel_port"} and all(ports.values())
    with RawClient(ports["command_port"]) as client, RawFeed(ports["status_port"]) as feed:
        assert client.ask("get_dh_param")["dh_param"][1][2] == 595.0
        assert feed.frame()["enabled"] is True
        program.send_signal(number)
        out, error = program.communicate(timeout=20)
    assert (program.returncode, out, error) == (0, "", "")


def test_panel_on_the_command_line(start):
    program, ports = start("--start", "enabled")
    port = str(ports["panel_port"])

    def panel(*arguments):
        return subprocess.run([*PROGRAM, "panel", "--port", port, *arguments], capture_output=True, text=True,
                              timeout=60)

    assert json.loads(panel("hit", "force=500").stdout) == {"noticed": True}
    assert json.loads(panel("state").stdout)["state"]["protective_stop"] is True
    assert json.loads(panel("set_input", "bank=tool", "index=2", "value=1").stdout) == {}
    failed = panel("stall", "port=attic")
    assert failed.returncode == 1 and failed.stderr.startswith("jaka_sim: error: ") and not failed.stdout
    assert panel("dance").returncode == 2 and panel("hit", "force").returncode == 2
    program.send_signal(signal.SIGINT)
    program.communicate(timeout=20)
    gone = panel("state")
    assert gone.returncode == 1 and gone.stderr.startswith("jaka_sim: error: no operator port answers")


@pytest.mark.parametrize("source", ["--dialect", "--dialect-seed", None])
def test_a_dialect_is_an_option_and_is_printed(start, tmp_path, source):
    drawn = Dialect.from_seed(7, "1.7")
    (tmp_path / "dialect.yaml").write_text(json.dumps(drawn.as_dict()), encoding="utf-8")
    value = {"--dialect": [str(tmp_path / "dialect.yaml")], "--dialect-seed": ["7"]}.get(source, [])
    program, ports = start("--firmware", "1.7", *filter(None, [source, *value]))
    expected = drawn if source else Dialect.default("1.7")
    with RawClient(ports["command_port"]) as client:
        assert ("vendorTrace" in client.ask("get_version")) is expected.unknown_reply_fields is bool(source)
    program.send_signal(signal.SIGINT)
    _, error = program.communicate(timeout=20)
    assert error == ("jaka_sim: dialect %s\n" % json.dumps(drawn.as_dict()) if source else "")


def test_a_wrong_dialect_is_an_error_with_its_reason(tmp_path):
    (tmp_path / "dialect.yaml").write_text("inpos: sometimes", encoding="utf-8")
    failed = subprocess.run([*PROGRAM, *FREE, "--dialect", str(tmp_path / "dialect.yaml")], capture_output=True,
                            text=True, timeout=60)
    assert failed.returncode == 1 and "inpos is 'sometimes'; it must be one of exact, early, late" in failed.stderr
    both = subprocess.run([*PROGRAM, *FREE, "--dialect", "a", "--dialect-seed", "1"], capture_output=True, text=True,
                          timeout=60)
    assert both.returncode == 2


def test_a_force_sensor_is_an_option(start):
    for options in (("--force-sensor",), ()):
        _, ports = start(*options)
        with RawFeed(ports["status_port"]) as feed:
            raw = feed.frame()["torqsensor"][1][3]
        assert any(raw) is bool(options)


def test_log_is_whole_after_a_signal(start, tmp_path):
    path = tmp_path / "wire.mcap"
    program, ports = start("--log", str(path), "--firmware", "1.7")
    with RawClient(ports["command_port"]) as client:
        assert client.ask("get_version")["version"].startswith("1.7")
    program.send_signal(signal.SIGTERM)
    program.communicate(timeout=20)
    assert program.returncode == 0
    assert path.read_bytes().endswith(b"\x89MCAP0\r\n")
    assert any(getattr(entry, "data", b"").startswith(b'{"cmdName"') for entry in read_log(str(path)))


def test_listening_for_all_is_warned_of(start):
    program, ports = start("--host", "0.0.0.0", "--panel-port", "-1")
    assert ports["panel_port"] is None
    program.send_signal(signal.SIGTERM)
    _, error = program.communicate(timeout=20)
    assert re.match("jaka_sim: warning: .*0.0.0.0", error)


@pytest.mark.parametrize("arguments, code, words", [
    (["--model", "zu99"], 1, "unknown arm model 'zu99'"),
    (["--time-scale", "0"], 1, "time scale"),
    (["--power-delay", "-1"], 1, "delays"),
    (["--dh-file", "missing.yaml"], 1, "missing.yaml"),
    (["--log", "/no/such/folder/x.mcap"], 1, "cannot write"),
    (["--host", "203.0.113.7"], 1, "error"),
    (["--firmware", "9"], 2, "invalid choice"),
    (["--unknown"], 2, "unrecognized"),
    (["panel"], 2, "required"),
    (["--command-port", "70000"], 2, "must be from 0 to 65535"),
    (["--panel-port", "-2"], 2, "must be from -1 to 65535"),
    (["--status-port", "x"], 2, "invalid"),
    (["panel", "--port", "70000", "state"], 2, "must be from 1 to 65535"),
    (["proxy", "10.0.0.1", "--log", "no.mcap", "--controller-command-port", "70000"], 2, "must be from 1 to 65535"),
    (["proxy", "10.0.0.1", "--log", "no.mcap", "--status-port", "70000"], 2, "must be from 0 to 65535"),
])
def test_wrong_use(arguments, code, words, capsys):
    try:
        result = main(arguments + ([] if arguments[0] in ("panel", "proxy") else FREE))
    except SystemExit as end:
        result = end.code
    assert result == code
    captured = capsys.readouterr()
    assert words in captured.err and captured.out == ""


def test_no_delay_where_none_is_wanted(start):
    program, ports = start("--power-delay", "0", "--enable-delay", "0")
    with RawClient(ports["command_port"]) as client, RawFeed(ports["status_port"]) as feed:
        assert client.code("power_on") == "0"
        feed.until(lambda frame: frame["powered_on"] == 1)
        assert client.code("enable_robot") == "0"
        feed.until(lambda frame: frame["enabled"])
    assert program.poll() is None
