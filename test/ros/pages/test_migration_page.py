"""The page docs/migration.md: each of its commands, in its order; a simulated controller stands for the arm.

The folder holds what the page speaks of: the checkout, a workspace with packages named as the maker's, a cell. What the
cell's node does before and after is test_migrated_cell.py's.
"""
import contextlib
import shutil
import subprocess

import import_graph
import pytest
from driver_bench import SimulatorProcess
from page_commands import Shell, blocks, until

PAGE = import_graph.ROOT / "docs" / "migration.md"
ARM = "ip:=10.5.5.100"
OLD = "{ [ ! -e catkin_ws/devel ] || . catkin_ws/devel/setup.bash; }"
"""The reader's shell before: the old workspace."""
CELL = import_graph.ROOT / "test" / "data" / "migration"
LAUNCH = "launch/cell.launch"
LANGUAGES = "gencpp:geneus:genlisp:gennodejs"
"""Languages of messages that no command of the page needs: C++ alone would cost a third of each build."""
MAKERS_DRIVER = {
    "package.xml": """<package format="3">
  <name>jaka_driver</name> <version>0.0.0</version> <description>Stands for the maker's.</description>
  <maintainer email="nobody@example.com">nobody</maintainer> <license>none</license>
  <buildtool_depend>catkin</buildtool_depend> <depend>jaka_msgs</depend>
</package>
""",
    "CMakeLists.txt": """cmake_minimum_required(VERSION 3.0.2)
project(jaka_driver)
find_package(catkin REQUIRED COMPONENTS jaka_msgs)
catkin_package()
""",
}


@pytest.fixture
def cell(root, tmp_path):
    """Make the folder in which the page's commands run."""
    (tmp_path / "jaka_ros_driver").symlink_to(root)
    source = tmp_path / "catkin_ws" / "src"
    source.mkdir(parents=True)
    shutil.copytree(str(root / "test" / "packaging" / "other_jaka_msgs"), str(source / "jaka_msgs"))
    (source / "jaka_driver").mkdir()
    for name, text in MAKERS_DRIVER.items():
        (source / "jaka_driver" / name).write_text(text)
    shutil.copytree(str(CELL), str(tmp_path / "my_cell"))
    return tmp_path


@pytest.fixture
def shell(cell, ros_master):
    """Return a shell with nothing of the one that runs the tests: no other workspace, no other interpreter."""
    environment = {"PATH": "/usr/bin:/bin", "HOME": str(cell), "ROS_HOME": str(cell), "LANG": "C.UTF-8",
                   "ROS_LANG_DISABLE": LANGUAGES, "ROS_MASTER_URI": ros_master, "ROS_IP": "127.0.0.1"}
    one = Shell(cell, environment, OLD)
    code, said = one.run("catkin_make -C catkin_ws")
    assert code == 0, said
    yield one
    one.close()


def with_ports(command, status):
    """Add ports that a test can have, and no guard: on a busy host a driver that gets no time is as good as dead."""
    return " command_port:=%d status_port:=%d guard:=false" % (command, status)


def add_ports(path, command, status):
    """Add them to a launch file of the cell, which has no arguments for them; interface and model must be there."""
    text = path.read_text()
    assert text == (CELL / LAUNCH).read_text().replace("jaka_driver", "jaka_ros_driver").replace(
        '.launch">\n', '.launch">\n    <arg name="interface" value="vendor"/>\n    <arg name="model" value="zu7"/>\n')
    words = [word.split(":=") for word in with_ports(command, status).split()]
    more = ['    <arg name="%s" value="%s"/>\n' % (name, value) for name, value in words]
    path.write_text(text.replace("  </include>", "".join(more) + "  </include>"))


def wait_for(shell, name, note):
    words = {"when the arm is enabled": "the arm is powered and enabled",
             "when the driver is connected": "SIMULATED ARM"}[note]
    until(lambda: words in shell.said_by(name), lambda: shell.said_by(name))


@pytest.mark.timeout(900)
def test_each_command_of_the_page(shell, cell, free_ports):
    background, ran = "", 0
    with contextlib.closing(SimulatorProcess()) as arm:
        at_the_arm = "ip:=127.0.0.1 sim:=false" + with_ports(arm.command_port, arm.status_port)
        for block in blocks(PAGE):
            assert block.language == "sh"
            name = ""
            for note in filter(None, block.note.split("; ")):
                what, _, of = note.partition(": ")
                if what == "after the end of":
                    shell.end(of)
                elif what == "in the background":
                    background = name = of
                else:
                    wait_for(shell, background, note)
            if name:
                shell.start(name, block.text.strip().replace(ARM, at_the_arm))
                ran += 1
                continue
            for line in block.text.strip().splitlines():
                code, said = shell.run(line)
                ran += 1
                assert code == 0, "%s\n%s" % (line, said)
                assert "ret: 0" not in said and "success: False" not in said, "%s\n%s" % (line, said)
                if line.startswith(". "):
                    shell.prelude = "%s && %s" % (OLD, line)
                    assert shell.run("rospack find jaka_driver")[0] == 0, "the old workspace is not in force any more"
                elif line.startswith("rosmsg show"):
                    assert "motion_state" in said, "the old workspace's messages are in front"
                elif "tool_position" in line:
                    assert largest_number(said) > 20.0, "mm: %s" % said
                elif "--write" in line:
                    assert "+    <arg name=\"model\" value=\"zu7\"/>" in said, said
                    add_ports(cell / "my_cell" / LAUNCH, *free_ports(2))
                elif "--nodes" in line:
                    assert said.split() == ["/jaka_sim", "/jaka_driver"] or said.split() == ["/jaka_driver"], said
                elif line == "rm -r jaka_ws":
                    shell.prelude = OLD
    assert ran > 20
    changed = subprocess.run(["diff", "-r", str(CELL), str(cell / "my_cell")], stdout=subprocess.PIPE, text=True)
    assert changed.returncode == 0, changed.stdout


def largest_number(said):
    """Return the largest number of a TwistStamped, its header left out."""
    numbers = [line.split(":")[1] for line in said.partition("twist:")[2].splitlines()
               if line.strip()[:2] in ("x:", "y:", "z:")]
    return max(abs(float(number)) for number in numbers)
