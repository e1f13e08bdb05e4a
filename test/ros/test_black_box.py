"""The black box that robot_start_launch.launch starts beside a driver: an emergency stop leaves a complete file."""
import contextlib
import json
import os
import shlex
import signal
import subprocess
import sys
import time

import pytest
import roslaunch
from driver_bench import rosservice
from import_graph import ROOT
from waiting import WAIT, eventually

from jaka_bag.cli.main import main
from jaka_bag.containers.registry import open_log, read_index, read_metadata

START = str(ROOT / "launch" / "robot_start_launch.launch")


def black_boxes(*arguments):
    config = roslaunch.config.load_config_default([(START, list(arguments))], None, verbose=False)
    return [node for node in config.nodes if node.type == "jaka_bag"]


def test_it_is_not_started_unless_asked_for():
    assert not black_boxes()


def test_it_has_low_priority_and_takes_a_folder_with_spaces():
    (node,) = black_boxes("black_box:=/data/black box", "ip:=10.5.5.100")
    assert not node.respawn and not node.required and node.launch_prefix.startswith("nice -n 10 ")
    words = shlex.split(node.args)
    assert words[words.index("--black-box") + 1] == "/data/black box" and "--state-log" in words


FAILS = "import sys; open(sys.argv[1], 'a').write('x'); sys.exit(int(sys.argv[2]))"


@pytest.mark.parametrize("code, at_least", [(0, 1), (1, 2), (2, 1)])
def test_it_is_started_again_after_a_crash_alone(tmp_path, code, at_least):
    with under_prefix(tmp_path, code) as process:
        assert eventually(lambda: len(starts(tmp_path)) >= at_least)
        if code != 1:
            assert process.wait(WAIT) == code and len(starts(tmp_path)) == 1


def test_ctrl_c_between_two_tries_starts_it_no_more(tmp_path):
    with under_prefix(tmp_path, 1) as process:
        assert eventually(lambda: starts(tmp_path))
        time.sleep(0.5)  # a part of the pause of 2 s
        os.killpg(process.pid, signal.SIGINT)
        assert process.wait(WAIT) == 1
    assert len(starts(tmp_path)) == 1


def starts(folder):
    path = folder / "starts"
    return path.read_text() if path.exists() else ""


@contextlib.contextmanager
def under_prefix(folder, code):
    """Run a process that ends with this exit code as the launch file starts the black box, in a group of its own."""
    (node,) = black_boxes("black_box:=/data", "ip:=10.5.5.100")
    command = [*shlex.split(node.launch_prefix), sys.executable, "-c", FAILS, str(folder / "starts"), str(code)]
    process = subprocess.Popen(command, start_new_session=True)
    try:
        yield process
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def triggers_of(path):
    index = read_index(path)
    return [read_metadata(index, entry) for entry in index.metadata if entry.name == "jaka_bag.trigger"]


def test_an_emergency_stop_leaves_a_file_that_is_complete(ros_node, simulator, driven_by, tmp_path, capsys):
    folder = tmp_path / "black box"
    with driven_by(simulator, "black_box:=%s" % folder, "black_box_args:=--before 5s --after 1s") as arm:
        arm.wait_until_ready()
        assert eventually(lambda: rosservice("/jaka_black_box/trigger") and list(folder.glob("*.mcap*")))
        arm.listen("/diagnostics", 3)
        simulator.operate("press_emergency_stop")

        def with_stop():
            return [path for path in folder.glob("*.mcap")
                    if "emergency_stop" in [trigger["kind"] for trigger in triggers_of(path)]]
        assert eventually(with_stop, WAIT)
        simulator.operate("release_emergency_stop")
        simulator.operate("clear_faults")
    path = with_stop()[0]
    with open_log(path) as log:
        attached = {entry.name: log.read_attachment(entry) for entry in log.index.attachments}
        topics = {connection.topic for connection in log.connections}
    assert {"/jaka_driver/joint_position", "/jaka_driver/robot_states", "/diagnostics", "/joint_states"} <= topics
    assert b"<robot" in attached["robot_description.urdf"]
    assert b"zu7" in attached["arm_models.yaml"]
    assert json.loads(attached["rosparam.yaml"])["jaka_driver"]["model"] == "zu7"
    assert "jaka_bag" in json.loads(attached["versions.json"])
    events = [status["values"].get("event") for name, status in json.loads(attached["diagnostics.json"]).items()
              if name.endswith("controller state")]
    assert len(events) == 1
    assert main(["info", str(path)]) == 0
    said = capsys.readouterr().out
    for words in ("emergency_stop on /jaka_driver/robot_states", "clock: ", "host: ", "driver_version: ",
                  "controller_version: ", "model: zu7", "missing: nothing", "robot_description.urdf"):
        assert words in said, said
