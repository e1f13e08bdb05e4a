"""The package in workspaces with others: a C++ user of its messages, and another jaka_msgs."""
import os
from pathlib import Path

import pytest

BUILDERS = ("catkin_make", "catkin_make_isolated")
NO_OTHERS = "gencpp:geneus:genlisp:gennodejs"
"""Languages of messages without Python: what is built before the subject of a test needs none of them."""


def builder_command(builder, cmake_options, *more):
    separator = "--cmake-args" if builder == "catkin_make_isolated" else ""
    return " ".join((builder,) + more + (separator,) + tuple(cmake_options))


def test_a_cpp_package_speaks_the_same_types(make_workspace, shell, cmake_options):
    # by the builder with which a package finds only what the others export; catkin_make: below, and docs/migration.md
    workspace = make_workspace("cpp_client")
    shell(builder_command("catkin_make_isolated", cmake_options, "--install"), cwd=workspace,
          ROS_LANG_DISABLE="geneus:genlisp:gennodejs")
    for space in ("devel_isolated", "install_isolated"):
        setup = workspace / space / "setup.bash"
        md5s = shell("rossrv md5 jaka_msgs/Move; rosmsg md5 jaka_msgs/RobotMsg; rossrv md5 jaka_msgs/ServoMove; "
                     "rossrv md5 jaka_msgs/ClearError", setup).stdout.split()
        request_length = 4 + 6 * 4 + 1 + 4 + 4 * 4 + 2 * 2
        assert shell("rosrun cpp_client print_md5", setup).stdout.split() == [str(request_length), *md5s]
        shell("rosrun jaka_ros_driver jaka_sim --help", setup)
        shell("rosrun jaka_ros_driver jaka_bag --help; /usr/bin/python3 -c 'import jaka_bag, jaka_regression'", setup)


@pytest.mark.parametrize("builder", BUILDERS)
def test_another_jaka_msgs_in_the_workspace_is_an_error_with_two_ways_out(builder, make_workspace, shell,
                                                                          cmake_options, root):
    workspace = make_workspace("other_jaka_msgs")
    said = shell(builder_command(builder, cmake_options), cwd=workspace, check=False, ROS_LANG_DISABLE=NO_OTHERS)
    assert said.returncode != 0
    other = workspace / "src" / "other_jaka_msgs"
    for part in ("two packages named jaka_msgs", "jaka_ros_driver/jaka_msgs", str(other),
                 "touch %s/CATKIN_IGNORE" % other, "export JAKA_MSGS_EXTERNAL=1"):
        assert part in said.stdout


def test_the_other_jaka_msgs_can_be_ignored_and_is_seen_when_it_comes_later(make_workspace, shell, cmake_options):
    workspace = make_workspace()
    other = workspace / "src" / "other"
    other.mkdir()
    for path in Path(__file__).with_name("other_jaka_msgs").iterdir():
        os.symlink(str(path), str(other / path.name))
    (other / "CATKIN_IGNORE").touch()
    shell(builder_command("catkin_make", cmake_options, "check_jaka_msgs_is_alone"), cwd=workspace)
    (other / "CATKIN_IGNORE").unlink()
    said = shell("make -C build check_jaka_msgs_is_alone", cwd=workspace, check=False)
    assert said.returncode != 0 and "two packages named jaka_msgs" in said.stdout


def test_the_other_jaka_msgs_can_be_used(make_workspace, shell, cmake_options):
    workspace = make_workspace("other_jaka_msgs")
    shell(builder_command("catkin_make", cmake_options), cwd=workspace, JAKA_MSGS_EXTERNAL="1",
          ROS_LANG_DISABLE=NO_OTHERS)
    setup = workspace / "devel" / "setup.bash"
    assert "float32[] speed" in shell("rossrv show jaka_msgs/ServoMove", setup).stdout, "the maker's definition"
    shell("rosrun jaka_ros_driver jaka_sim --help", setup)
    shell("rosrun jaka_ros_driver jaka_driver --help", setup)
    shell("/usr/bin/python3 -c 'import jaka_ros_driver.ros.node'", setup)


def test_asking_for_an_external_jaka_msgs_that_is_not_there_is_an_error(root, shell, cmake_options, tmp_path):
    said = shell("cmake -S %s -B build %s" % (root, " ".join(cmake_options)), cwd=tmp_path, check=False,
                 JAKA_MSGS_EXTERNAL="1")
    assert said.returncode != 0
    assert "or unset JAKA_MSGS_EXTERNAL to build the one in %s/jaka_msgs" % root in " ".join(said.stdout.split())
