"""The page docs/regression_testing.md: each of its commands as it stands there, in order, in a folder of its own."""
import os

import pytest
import yaml
from page_commands import Shell, blocks, until

from jaka_regression.scenario import parse_scenario

PAGE = "docs/regression_testing.md"


@pytest.fixture
def shell(root, tmp_path, ros_master):
    """Return a shell in a folder that has the build where the page places it; both logs are made beside other tests
    there."""
    (tmp_path / "build").symlink_to(root / "build")
    (tmp_path / "golden.yaml").write_text(yaml.safe_dump({"tolerances": yaml.safe_load(
        (root / "test" / "data" / "busy_host.yaml").read_text(encoding="utf-8"))}), encoding="utf-8")
    environment = dict(os.environ, ROS_MASTER_URI=ros_master)
    for name in ("PYTHONPATH", "PYTHONUNBUFFERED"):
        environment.pop(name, None)
    one = Shell(tmp_path, environment, ". build/devel/setup.bash")
    yield one
    one.close()


@pytest.mark.timeout(900)
def test_each_command_of_the_page(root, shell, free_ports):
    ports = " ".join("%s:=%d" % pair for pair in zip(("command_port", "status_port"), free_ports(2)))
    for block in blocks(root / PAGE):
        if block.note.startswith("the file: "):
            (shell.folder / block.note.split(": ")[1]).write_text(block.text)
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
            code, said = shell.run(line)
            assert code == 0, "%s\n%s" % (line, said)
            if line.startswith("rosservice"):
                assert "ret: 1" in said
    folder = shell.folder / "jaka_reports" / "test_cell.py_test_cell"
    assert {"report.html", "report.xml", "report.json", "candidate.mcap"} <= {path.name for path in folder.iterdir()}
    assert (shell.folder / "results.xml").exists()


def test_the_example_of_a_scenario_is_understood(root):
    (text,) = [block.text for block in blocks(root / PAGE) if block.language == "yaml"]
    scenario = parse_scenario(text, "golden.yaml")
    assert scenario.events[0].request["action"] == "hit" and yaml.safe_load(text)
