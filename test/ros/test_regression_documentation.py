"""docs/regression_testing.md: each command of it, in its order, in a folder of its own, as it stands there."""
import os
import re
import signal
import subprocess
import time
from typing import NamedTuple

import pytest
import yaml

from jaka_regression.scenario import parse_scenario

WAIT = 280


class Block(NamedTuple):
    note: str
    language: str
    text: str


def blocks(root):
    text = (root / "docs" / "regression_testing.md").read_text(encoding="utf-8")
    return [Block(*found) for found in re.findall(r"(?:<!-- (.*?) -->\n)?```(\w+)\n(.*?)```", text, re.DOTALL)]


class Shell:
    """bash in a folder that has the build where the page says it is."""

    def __init__(self, root, folder, uri):
        (folder / "build").symlink_to(root / "build")
        self.folder = folder
        self.environment = dict(os.environ, ROS_MASTER_URI=uri)
        for name in ("PYTHONPATH", "PYTHONUNBUFFERED"):
            self.environment.pop(name, None)
        self.running = {}

    def _start(self, line, **options):
        return subprocess.Popen(["bash", "-c", ". build/devel/setup.bash && " + line], cwd=str(self.folder),
                                env=self.environment, start_new_session=True, **options)

    def run(self, line):
        process = self._start(line, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        said = process.communicate(timeout=WAIT)[0]
        return process.returncode, said

    def start(self, name, line):
        output = open(str(self.folder / (name + ".txt")), "w")
        self.running[name] = self._start("exec " + line, stdout=output, stderr=subprocess.STDOUT)
        output.close()

    def end(self, name):
        process = self.running.pop(name)
        os.killpg(process.pid, signal.SIGINT)
        process.wait(WAIT)

    def close(self):
        for name in list(self.running):
            self.end(name)

    def said_by(self, name):
        return (self.folder / (name + ".txt")).read_text(errors="replace")


@pytest.fixture
def shell(root, tmp_path, ros_master):
    one = Shell(root, tmp_path, ros_master)
    yield one
    one.close()


def until(condition, what):
    deadline = time.monotonic() + WAIT
    while not condition():
        assert time.monotonic() < deadline, what
        time.sleep(0.2)


@pytest.mark.timeout(900)
def test_each_command_of_the_page(root, shell, free_ports):
    ports = " ".join("%s:=%d" % pair for pair in zip(("command_port", "status_port"), free_ports(2)))
    for block in blocks(root):
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
                until(lambda: "the arm is powered and enabled" in shell.said_by("driver"), shell.said_by("driver"))
            else:
                until(lambda: "recording to" in shell.said_by("recorder"), shell.said_by("recorder"))
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
    (text,) = [block.text for block in blocks(root) if block.language == "yaml"]
    scenario = parse_scenario(text, "golden.yaml")
    assert scenario.events[0].request["action"] == "hit" and yaml.safe_load(text)
