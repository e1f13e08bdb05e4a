"""The README's commands for the other shell, as they stand there, against the demo."""
import re
import subprocess
import time

import pytest

DEADLINE_S = 60.0


def commands_of_the_other_shell(root):
    section = re.search(r"## In another shell\n+```sh\n(.*?)```", (root / "README.md").read_text(), re.DOTALL)
    return section.group(1).splitlines()


@pytest.fixture
def run(root, tmp_path):
    """Return a function that runs one line in bash, in a folder that has the build where the README places it."""
    (tmp_path / "build").symlink_to(root / "build")

    def run_line(line):
        result = subprocess.run(["bash", "-c", ". build/devel/setup.bash && " + line], cwd=str(tmp_path), text=True,
                                stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=DEADLINE_S)
        return result.returncode, result.stdout

    return run_line


def test_the_other_shell(root, launch, ros_node, free_ports, run, tmp_path):
    setup, move, forward, stop, rate, record, info, convert, compare = commands_of_the_other_shell(root)
    assert run(setup)[0] == 0
    ports = zip(("command_port", "status_port", "sim_panel_port"), free_ports(3))
    launch("demo.launch", *("%s:=%d" % pair for pair in ports))

    code, said = run(move)
    deadline = time.monotonic() + DEADLINE_S
    while "ret: 1" not in said and time.monotonic() < deadline:  # the arm is being powered and enabled
        code, said = run(move)
    assert code == 0 and "ret: 1" in said, said
    code, said = run(forward)
    assert code == 0 and len(re.findall(r"-?\d+\.\d+", said)) == 6, said
    assert run(stop)[0] == 0
    code, said = run(rate)
    while "average rate" not in said and time.monotonic() < deadline:  # a busy host: its time was over at its start
        code, said = run(rate)
    assert code == 124 and "average rate: 1" in said, said

    for line in (record, info, convert, compare):
        code, said = run(line)
        assert code == 0, said
    assert all((tmp_path / ("run" + suffix)).stat().st_size > 0 for suffix in (".bag", ".mcap", ".html"))
    code, said = run(info.replace("run.bag", "run.mcap"))
    assert code == 0 and "/jaka_driver/joint_position" in said, said


def test_the_two_commands_come_first_and_are_those_of_tools_dev(root):
    first = re.search(r"```sh\n(.*?)```", (root / "README.md").read_text(), re.DOTALL).group(1).splitlines()
    assert [line.split("#")[0].strip() for line in first] == ["tools/dev demo", "tools/dev test"]
    usage = subprocess.run([str(root / "tools" / "dev"), "help"], stdout=subprocess.PIPE, text=True, check=True).stdout
    assert "tools/dev demo" in usage and "tools/dev test" in usage


def test_the_readme_is_at_most_two_screens(root):
    assert len((root / "README.md").read_text().splitlines()) <= 90
