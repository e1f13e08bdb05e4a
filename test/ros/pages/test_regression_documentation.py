"""The page docs/regression_testing.md: each of its commands as it stands there, in order, in a folder of its own."""
import os
import re
import shutil

import pytest
import yaml
from page_commands import Shell, blocks, until

from jaka_regression.scenario import CauseKind, parse_scenario

PAGE = "docs/regression_testing.md"
BUSY_HOST = "test/data/busy_host.yaml"


def tolerate(folder, tolerances):
    for name in ("golden.yaml", "cell.yaml"):
        (folder / name).write_text(yaml.safe_dump({"tolerances": tolerances}), encoding="utf-8")


@pytest.fixture
def shell(root, tmp_path, ros_master):
    """Return a shell in a folder that has the build where the page places it; both logs are made beside other tests
    there."""
    (tmp_path / "build").symlink_to(root / "build")
    (tmp_path / "my_cell").mkdir()
    shutil.copy(str(root / "test" / "data" / "cell" / "package.xml"), str(tmp_path / "my_cell"))
    tolerate(tmp_path, yaml.safe_load((root / BUSY_HOST).read_text(encoding="utf-8")))
    environment = dict(os.environ, ROS_MASTER_URI=ros_master)
    for name in ("PYTHONPATH", "PYTHONUNBUFFERED"):
        environment.pop(name, None)
    one = Shell(tmp_path, environment, ". build/devel/setup.bash && export ROS_PACKAGE_PATH=$PWD:$ROS_PACKAGE_PATH")
    yield one
    one.close()


@pytest.mark.timeout(900)
def test_each_command_of_the_page(root, shell, free_ports):
    ports = " ".join("%s:=%d" % pair for pair in zip(("command_port", "status_port"), free_ports(2)))
    for block in blocks(root / PAGE):
        if block.note.startswith("the file: "):
            path = shell.folder / block.note.split(": ")[1]
            path.write_text(block.text)
            path.chmod(0o755)
        if block.note.startswith("after the end of: "):
            for name in block.note.split(": ")[1].split(", "):
                shell.end(name)
        if block.language != "sh" or "tools/dev setup" in block.text:  # the set-up made this very build
            continue
        if block.note.startswith("in the background: "):
            name = block.note.split(": ")[1]
            shell.start(name, block.text.strip() + (" " + ports if name == "driver" else ""))
            if name == "driver":
                until(lambda: "the arm is powered and enabled" in shell.said_by("driver"),
                      lambda: shell.said_by("driver"))
            else:
                until(lambda: "recording to" in shell.said_by("recorder"), lambda: shell.said_by("recorder"))
            continue
        for line in block.text.strip().splitlines():
            if " compare golden.mcap jaka_reports" in line:  # what stands in golden.yaml counts for tests only
                line += " --tolerances %s" % (root / BUSY_HOST)
            code, said = shell.run(line)
            assert code == 0, "%s\n%s" % (line, said)
            if line.startswith("rosservice"):
                assert "ret: 1" in said
    for name in ("test_cell.py_test_cell", "test_nodes.py_test_nodes"):
        reports = {path.name for path in (shell.folder / "jaka_reports" / name).iterdir()}
        assert {"report.html", "report.xml", "report.json", "candidate.mcap"} <= reports
        assert ("scenario.yaml" in reports) == (name == "test_nodes.py_test_nodes")
    assert (shell.folder / "results.xml").exists()
    # the others fail in test_pytest_plugin.py and test_cell.py
    tolerate(shell.folder, {"calls": {"duration_s": 0, "duration_percent": 0}})  # no run is as exact as that
    (line,) = [line for block in blocks(root / PAGE) for line in block.text.strip().splitlines()
               if block.language == "sh" and line.startswith("rostest jaka_ros_driver replay_golden.test")]
    code, said = shell.run(line)
    assert code != 0 and "DIFFERENT" in said, "%s\n%s" % (line, said)
    code, said = shell.run(line + " --text")
    assert "DIFFERENT" in said and "RESULT: FAIL" in said
    assert code == 0, "rostest has learned to tell what --text shows: the page says that it does not\n%s" % said


def test_the_examples_of_a_scenario_are_understood(root):
    texts = [block.text for block in blocks(root / PAGE) if block.language == "yaml"]
    cell, golden = [parse_scenario(text, "golden.yaml") for text in texts]
    assert [event.request["action"] for event in cell.events] == ["set_input", "press_emergency_stop"]
    assert golden.events[0].request["action"] == "hit"


def test_the_table_of_causes_is_whole_and_understood(root):
    rows = re.findall(r"^\| `(after_\w+): (.*?)` \|", (root / PAGE).read_text(encoding="utf-8"), re.MULTILINE)
    assert {key for key, _ in rows} == {kind.value for kind in CauseKind if kind is not CauseKind.BEGIN}
    for key, value in rows:
        (event,) = parse_scenario("events: [{%s: %s, action: hit}]" % (key, value), "golden.yaml").events
        assert event.after.kind.value == key
