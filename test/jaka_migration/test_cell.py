"""The command migrate_cell: its report of a cell, the bytes that it writes, files that are not as they should be."""
import os
import re
import stat
import subprocess

import pytest
from command_places import command_of

from jaka_migration.cell import main
from jaka_migration.launch_changes import Wanted, examine
from jaka_migration.launch_file import UnreadableLaunchFile, elements

INCLUDE = b"""<launch>
  <arg name="ip"/>
  <!-- <include file="$(find jaka_driver)/launch/robot_start_launch.launch"/> -->
  <include file="$(find jaka_driver)/launch/robot_start_launch.launch">
    <arg name="ip" value="$(arg ip)"/>
  </include>
</launch>
"""
NODE = (b'<?xml version="1.0"?>\r\n<launch>\r\n\t<param name="ip" value=\'10.5.5.100\'/>\r\n'
        b'\t<node  pkg="jaka_driver" name="jaka_driver"\r\n\t\ttype="jaka_driver"   />\r\n</launch>')
ARM = b'<node pkg="jaka_driver" type="jaka_driver" name="jaka_driver"/>'
IP = b'<param name="ip" value="10.0.0.2"/>'
ALL_ARGS = b'<include file="$(find jaka_driver)/launch/robot_start_launch.launch" pass_all_args="true"/>'
PROGRAM = b"""#!/usr/bin/env python
# coding: gbk \xb0\xa1
from jaka_msgs.srv import ClearError, Move, SetIO
from geometry_msgs.msg import PoseStamped
call("/jaka_driver/servo_p")  # and "servo_j"
call("drag_move"), call("set_io"), call("jog"), call("set_toolframe")
# call("linear_move")
rospy.Subscriber("/jaka_driver/tool_position", PoseStamped, see)
address = rospy.get_param("/ip", "10.5.5.100")
"""
WRITE = ["--write", "--yes", "--interface", "vendor", "--model", "zu12"]
VENDOR = Wanted("vendor", "zu12")


def migrated(data, wanted=VENDOR):
    result = examine(data, wanted)
    assert not result.against, result.against
    return result.text


def lines_of_change(before, after):
    """Return the lines that are there afterwards only."""
    return [line for line in after.splitlines() if line not in before.splitlines()]


# ---- what is written ----

def test_an_include_gets_package_interface_and_model_and_nothing_else_changes():
    after = migrated(INCLUDE)
    assert lines_of_change(INCLUDE, after) == [
        b'  <include file="$(find jaka_ros_driver)/launch/robot_start_launch.launch">',
        b'    <arg name="interface" value="vendor"/>', b'    <arg name="model" value="zu12"/>']
    assert after.count(b"\n") == INCLUDE.count(b"\n") + 2 and b"<!-- <include file=\"$(find jaka_driver)" in after
    assert migrated(after) == after, "what is migrated stays as it is"


def test_a_node_gets_them_too_and_the_address_that_the_makers_driver_takes():
    assert migrated(NODE) == NODE.replace(b'pkg="jaka_driver"', b'pkg="jaka_ros_driver"').replace(b'"   />', (
        b'">\r\n\t\t<param name="interface" type="str" value="vendor"/>\r\n'
        b'\t\t<param name="model" type="str" value="zu12"/>\r\n'
        b"\t\t<param name=\"ip\" type=\"str\" value='10.5.5.100'/>\r\n\t</node>"))


def test_what_an_earlier_page_left_without_interface_and_model_gets_them():
    after = migrated(INCLUDE.replace(b"jaka_driver", b"jaka_ros_driver"), Wanted("vendor_2025", "zu5"))
    assert b'"interface" value="vendor_2025"' in after and b'"model" value="zu5"' in after


@pytest.mark.parametrize("text, why", [
    (b"<launch>" + ARM + b"</launch>", "no address.*--ip"),
    (b'<launch><param name="ip" value="1.2.3.4" if="$(arg a)"/>' + ARM + b'</launch>', "no address"),
    (b'<launch><group ns="a"><param name="ip" value="1.2.3.4"/></group><node pkg="jaka_driver" type="jaka_driver" '
     b'name="jaka_driver"/></launch>', "no address"),
    (b'<launch><include file="$(find jaka_driver)/launch/robot_start_launch.launch"/></launch>', "no address"),
    (INCLUDE.replace(b'<arg name="ip" v', b'<arg name="model" value="zu7"/><arg name="ip" v'),
     "line 5: model is 'zu7' already, and 'zu12'"),
    (INCLUDE.replace(b'<arg name="ip" v', b'<arg name="interface" value="vendor" if="$(arg a)"/><arg name="ip" v'),
     "line 5: interface is set under a condition"),
    (INCLUDE.replace(b'<arg name="ip" v', b'<arg name="model" value="zu12"/><arg name="model" value="zu5"/>'
                     b'<arg name="ip" v'), "line 5: model is 'zu5' already, and 'zu12'"),
    (b'<launch><param name="ip" value="1.2.3.4"/>' + ARM.replace(b"/>", b' args="1.2.3.4"/>') + b'</launch>',
     "line 1: the node has args"),
    (b'<launch><arg name="driver" default="jaka_driver"/></launch>', "changed by hand"),
    (b'<launch><include file="$(eval find(\'jaka_driver\') + \'/launch/robot_start_launch.launch\')"/></launch>',
     "changed by hand")])
def test_what_is_not_plain_is_left_as_it_is_with_the_reason(text, why, tmp_path, capsys):
    (tmp_path / "cell.launch").write_bytes(text)
    assert main([str(tmp_path), *WRITE]) == 1
    assert (tmp_path / "cell.launch").read_bytes() == text and not (tmp_path / "cell.launch.before").exists()
    assert re.search(why, capsys.readouterr().err)


@pytest.mark.parametrize("before, value", [
    (IP, b'"10.0.0.2"'), (b'<arg name="ip" default="10.0.0.2"/>', None), (b'<arg name="ip"/>', None)])
def test_an_include_that_passes_all_arguments_gets_the_address_where_no_argument_has_it(before, value):
    after = migrated(b"<launch>%s%s</launch>" % (before, ALL_ARGS))
    assert (b'<arg name="ip" value=%s/>' % value in after) if value else after.count(b'"ip"') == 1


@pytest.mark.parametrize("text, why", [
    (ALL_ARGS, "no address"), (b'<group><arg name="ip" value="10.0.0.2"/></group>' + ALL_ARGS, "no address"),
    (ALL_ARGS + b'<arg name="ip" value="10.0.0.2"/>', "no address"),
    (IP + b'<arg name="ip" value="10.0.0.3" if="$(arg real)"/>' + ALL_ARGS, "line 1: ip is set under a condition"),
    (IP + ALL_ARGS.replace(b"/>", b'><arg name="ip" value="10.0.0.2" if="$(arg real)"/></include>'),
     "line 1: ip is set under a condition"),
    (IP + ARM.replace(b"/>", b'><param name="ip" value="1.2.3.4"/><param name="ip" value="1.2.3.5" unless="$(arg a)"/>'
                             b"</node>"), "line 1: ip is set under a condition")])
def test_no_real_arm_becomes_a_simulated_one_for_an_address_under_a_condition(text, why):
    before = b"<launch>" + text + b"</launch>"
    result = examine(before, VENDOR)
    assert result.text == before and any(re.search(why, reason) for reason in result.against), result.against


@pytest.mark.parametrize("text", [
    IP + ARM.replace(b'name="jaka_driver"', b'name="left"'), IP + ARM.replace(b"/>", b' ns="left"/>'),
    b'<group ns="left">' + IP + ARM + b"</group>", IP + ALL_ARGS.replace(b"/>", b' ns="$(arg side)"/>'),
    b'<group ns="left"><group>' + IP + ALL_ARGS + b"</group></group>"])
def test_a_driver_whose_names_would_move_is_found_and_left_as_it_is(text, tmp_path, capsys):
    (tmp_path / "cell.launch").write_bytes(b"<launch>\n" + text + b"</launch>")
    assert main([str(tmp_path)]) == 0 and "its names move" in capsys.readouterr().out
    assert main([str(tmp_path), *WRITE]) == 1
    assert re.search("line 2: .*/jaka_driver/.*names.*not changed", capsys.readouterr().err)
    assert (tmp_path / "cell.launch").read_bytes() == b"<launch>\n" + text + b"</launch>"


def test_a_namespace_that_is_the_root_moves_no_name():
    assert b"jaka_ros_driver" in migrated(b'<launch><group ns="/">' + IP + ARM + b"</group></launch>")
    ours = ARM.replace(b'pkg="jaka_driver', b'pkg="jaka_ros_driver')
    after = migrated(b"<launch><group ns=\"left\">" + IP + ours + b"</group></launch>")
    assert b"zu12" in after, "names of this driver stay where they are"


def test_a_launch_file_that_ends_in_xml_is_read_by_its_root(tmp_path, capsys):
    (tmp_path / "driver.xml").write_bytes(b"<?xml version='1.0'?>\n<!-- <robot> -->" + INCLUDE)
    (tmp_path / "arm.urdf.xml").write_bytes(b'<!-- <launch> --><robot name="jaka_driver"/>')
    (tmp_path / "comments.xml").write_bytes(b"<!-- a -->" * 100000 + b"<robot/>")
    (tmp_path / "away.xml").symlink_to("driver.xml")
    (tmp_path / "package.xml").write_text("<package><name>cell</name></package>")
    os.mkfifo(str(tmp_path / "pipe.xml"))
    assert main([str(tmp_path), *WRITE]) == 0
    said = capsys.readouterr().out
    assert said.startswith("2 launch files and source files read, 1 drivers") and "away.xml: a link" in said
    assert b"jaka_ros_driver" in (tmp_path / "driver.xml").read_bytes()


def test_a_given_address_is_for_one_driver(tmp_path, capsys):
    (tmp_path / "cell.launch").write_bytes(b"<launch>%s</launch>" % ARM)
    assert main([str(tmp_path), *WRITE, "--ip", "10.5.5.101"]) == 0
    assert b'<param name="ip" type="str" value="10.5.5.101"/>' in (tmp_path / "cell.launch").read_bytes()
    (tmp_path / "two.launch").write_bytes(b"<launch>%s%s</launch>" % (ARM, ARM))
    assert main([str(tmp_path), *WRITE, "--ip", "10.5.5.101"]) == 1
    assert "one address to 2 drivers" in capsys.readouterr().err and not (tmp_path / "two.launch.before").exists()


def test_it_asks_before_it_writes_and_keeps_mode_and_the_bytes_as_they_were(tmp_path, capsys, monkeypatch):
    path = tmp_path / "cell.launch"
    path.write_bytes(INCLUDE)
    path.chmod(0o640)
    asked = ["--write", "--interface", "vendor", "--model", "Zu 12"]
    assert main([str(tmp_path), *asked]) == 1 and path.read_bytes() == INCLUDE
    assert "nobody can be asked" in capsys.readouterr().out
    monkeypatch.setattr("sys.stdin.isatty", lambda: True, raising=False)
    for answer, code in (("n", 1), ("", 1), ("y", 0)):
        monkeypatch.setattr("builtins.input", lambda _, answer=answer: answer)
        assert main([str(path), *asked]) == code
        said = capsys.readouterr().out
        assert "+    <arg name=\"model\" value=\"zu12\"/>" in said and ("written: cell.launch" in said) is (code == 0)
    assert path.read_bytes() == migrated(INCLUDE) and stat.S_IMODE(path.stat().st_mode) == 0o640
    assert (tmp_path / "cell.launch.before").read_bytes() == INCLUDE
    assert sorted(os.listdir(str(tmp_path))) == ["cell.launch", "cell.launch.before"]
    path.write_bytes(INCLUDE)
    assert main([str(path), *WRITE]) == 1 and path.read_bytes() == INCLUDE
    assert "cell.launch.before is there already" in capsys.readouterr().err


# ---- what is reported ----

def test_each_subject_is_reported_with_its_lines_and_nothing_is_changed(tmp_path, capsys):
    (tmp_path / "launch").mkdir()
    (tmp_path / "launch" / "cell.launch").write_bytes(NODE.replace(b"</launch>", b'<include file="$(find jaka_planner)/'
                                                                   b'launch/moveit_server.launch"/></launch>'))
    (tmp_path / "pick").write_bytes(PROGRAM)
    (tmp_path / "package.xml").write_text("<package><name>cell</name><exec_depend>jaka_driver</exec_depend></package>")
    (tmp_path / "other.py").write_text('call("servo_p")  # of another robot\n')
    (tmp_path / "node.cpp").write_text('auto c = n.serviceClient<jaka_msgs::GetIO>("/jaka_driver/get_io");\n'
                                       '// "/jaka_driver/servo_j"\n')
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    assert main([str(tmp_path)]) == 0
    said = capsys.readouterr().out
    for place in ("launch/cell.launch:4: <node pkg=\"jaka_driver\"", "launch/cell.launch:3: <param",
                  "launch/cell.launch:6:", "package.xml:1:", "pick:3: from jaka_msgs.srv import ClearError", "pick:5:",
                  "pick:6:", "pick:8:", "pick:9:", "node.cpp:1:", "vendor_2025: pick"):
        assert place in said, place
    assert "pick:7" not in said and "other.py" not in said and "node.cpp:2" not in said and "\\xb0" not in said
    for title in ("maker's driver is started", "MoveIt server", "parameter ip", "servo_p", "servo_j", "jog", "set_io",
                  "hand guiding", "clearing errors", "set_toolframe", "tool_position", "dependency"):
        assert title in said, title
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before


PUBLISHED = {  # the shapes of clients that people have published, one line each
    "sum.py": (b'self.c = rospy.ServiceProxy(ns + "/linear_move", Move)', "linear_move: its orientation"),
    "fstring.py": (b"self.c = rospy.ServiceProxy(f'{ns}/servo_p', ServoMove)", "servo_p"),
    "relative.py": (b"rospy.wait_for_service('jaka_driver/set_io')", "set_io, get_io: the index"),
    "left.py": (b'rospy.ServiceProxy("/left_jaka_driver/jog", jaka_msgs.srv.Move)', "jog: its speed"),
    "split.py": (b'client = rospy.ServiceProxy(\n    "/jaka_driver/servo_j", ServoMove)', "servo_j"),
    "parameter.py": (b"self.c = rospy.ServiceProxy(self.service, ServoMove)", "service is named elsewhere"),
    "whole.py": (b"c = rospy.ServiceProxy(name, jaka_msgs.srv.SetIO, persistent=True)", "service is named elsewhere"),
    "typed.cpp": (b'c = nh.serviceClient<jaka_msgs::Move>("/jaka_driver/linear_move");', "linear_move"),
    "member.cpp": (b"c_ = nh_.serviceClient<jaka_msgs::Move>(linear_move_service_);", "service is named elsewhere"),
    "default.cpp": (b'n.param<std::string>("s", s_, std::string("/jaka_driver/linear_move"));', "linear_move"),
    "header.cpp": (b'#include "jaka_driver/JAKAZuRobot.h"', "maker's SDK in your code"),
    "login.cpp": (b'robot.login_in("10.5.5.100");', "maker's SDK in your code"),
    "module.py": (b"import jkrc", "maker's SDK in your code"),
    "cfg.yaml": (b"linear_move_service: /jaka_driver/linear_move", "linear_move: its orientation"),
    "call.sh": (b'rosservice call /jaka_driver/servo_p "{pose: [1, 0, 0, 0, 0, 0]}"', "servo_p"),
    "value.launch": (b'<launch><param name="s" value="/jaka_driver/servo_p"/></launch>', "servo_p"),
    "default.launch": (b'<launch><arg name="s" default="jaka_driver/set_io"/></launch>', "set_io, get_io: the index"),
    "remap.launch": (b'<launch><node pkg="a" type="b" name="c"><remap from="x" to="/jaka_driver/jog"/></node></launch>',
                     "jog: its speed"),
}


@pytest.mark.parametrize("name", PUBLISHED)
def test_each_spelling_of_published_clients_is_found(name, tmp_path, capsys):
    line, title = PUBLISHED[name]
    before = b"# from jaka_msgs.srv import *\n" if name.endswith(".py") else b""
    (tmp_path / name).write_bytes(before + line + b"\n")
    assert main([str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert title in said and re.search(r"^    %s:\d: " % re.escape(name), said, re.MULTILINE), said


@pytest.mark.parametrize("name, line", [
    ("a.py", b"rospy.ServiceProxy(self.service, Trigger)  # jaka_msgs"),
    ("b.py", b'rospy.ServiceProxy("/jaka_driver/joint_move", Move)'),
    ("c.cpp", b'n.serviceClient<jaka_msgs::Move>("/jaka_driver/joint_move");'),
    ("d.launch", b'<launch><param name="s" value="/other/servo_p"/></launch>'),
    ("e.cpp", b"// robot.login_in(ip);")])
def test_what_means_the_same_here_is_not_reported(name, line, tmp_path, capsys):
    (tmp_path / name).write_bytes(line + b"\n")
    assert main([str(tmp_path)]) == 0
    assert "there: " not in capsys.readouterr().out


def test_the_makers_own_packages_and_what_a_build_makes_are_passed_over(tmp_path, capsys):
    for folder in ("src/jaka_driver", "build/x", "src/cell", ".git"):
        (tmp_path / folder).mkdir(parents=True)
        (tmp_path / folder / "a.launch").write_bytes(INCLUDE)
    (tmp_path / "src/jaka_driver/package.xml").write_text("<package>\n <name>jaka_driver</name></package>")
    assert main([str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert "1 drivers started" in said and "src/cell/a.launch:4" in said
    assert "src/jaka_driver: the package jaka_driver itself" in said


# ---- files that are not as they should be ----

def test_hostile_files_cost_a_line_each(tmp_path, capsys):
    cell, outside = tmp_path / "cell", tmp_path / "outside"
    cell.mkdir()
    outside.mkdir()
    for folder in (cell, outside):
        (folder / "good.launch").write_bytes(INCLUDE)
    (cell / "loop").symlink_to(cell)
    (cell / "self.launch").symlink_to("self.launch")
    (cell / "away.launch").symlink_to(outside / "good.launch")
    (cell / "gone.py").symlink_to("nothing")
    os.mkfifo(str(cell / "pipe.py"))
    (cell / "binary.py").write_bytes(b"jaka_driver\0")
    (cell / "huge.yaml").write_bytes(b"a" * (4 * 1024 * 1024 + 1))
    (cell / "cut.launch").write_bytes(INCLUDE[:-20])
    (cell / "utf16.launch").write_bytes(INCLUDE.decode().encode("utf-16")[:2])
    (cell / "gbk.launch").write_bytes(b'<?xml version="1.0" encoding="gbk"?><launch/>')
    (cell / "latin.launch").write_bytes(b"<launch><!-- \xe9 --></launch>")
    (cell / "laughs.launch").write_bytes(b'<!DOCTYPE a [<!ENTITY b "c">]><launch>&b;</launch>')
    (cell / "\x1b[31mred\n.launch").write_bytes(b"<launch")
    (cell / "deep.launch").write_bytes(b"<a>" * 200000)
    folder = cell
    for _ in range(300):
        folder = folder / "d"
    folder.mkdir(parents=True)
    assert main([str(cell), *WRITE]) == 1
    said = capsys.readouterr()
    lines = said.err.splitlines()
    assert len(lines) == 10 and all(line.startswith("migrate_cell: ") for line in lines), said.err
    for words in ("pipe.py: no plain file", "binary.py: binary", "huge.yaml: larger than 4 MB", "cut.launch: line 6",
                  "utf16.launch: line 1", "gbk.launch: line 1: the encoding gbk", "latin.launch: line 1",
                  "laughs.launch: line 1: it declares an entity", "\\x1b[31mred\\n.launch: line 1",
                  "deep.launch: line 1"):
        assert words in said.err, words
    for words in ("loop: a link to a folder", "self.launch: a link", "away.launch: a link", "gone.py: a link"):
        assert words in said.out, words
    assert (cell / "good.launch").read_bytes() == migrated(INCLUDE)
    assert (outside / "good.launch").read_bytes() == INCLUDE and len(list(outside.iterdir())) == 1


def test_a_folder_that_becomes_a_link_out_of_the_cell_is_not_written_through(tmp_path, monkeypatch, capsys):
    cell, outside = tmp_path / "cell", tmp_path / "outside"
    for folder in (cell / "launch", outside):
        folder.mkdir(parents=True)
        (folder / "a.launch").write_bytes(INCLUDE)
    monkeypatch.setattr("sys.stdin.isatty", lambda: True, raising=False)

    def exchange(_):
        (cell / "launch").rename(cell / "was")
        (cell / "launch").symlink_to(outside)
        return "y"
    monkeypatch.setattr("builtins.input", exchange)
    assert main([str(cell), *WRITE[:1], *WRITE[2:]]) == 1
    assert "launch/a.launch: a link" in capsys.readouterr().err
    assert (outside / "a.launch").read_bytes() == INCLUDE and len(list(outside.iterdir())) == 1


def test_what_has_changed_since_it_was_shown_is_not_overwritten(tmp_path, monkeypatch, capsys):
    path = tmp_path / "a.launch"
    path.write_bytes(INCLUDE)
    monkeypatch.setattr("sys.stdin.isatty", lambda: True, raising=False)
    monkeypatch.setattr("builtins.input", lambda _: (path.write_bytes(NODE), "y")[1])
    assert main([str(path), *WRITE[:1], *WRITE[2:]]) == 1
    assert path.read_bytes() == NODE and "changed while it was looked at" in capsys.readouterr().err


@pytest.mark.parametrize("words, why", [
    (["{}", "--write"], "--write needs --interface and --model"), (["{}", "--write", "--model", "zu7"], "--interface"),
    (["{}", "--model", "zu77"], "zu77"), (["{}", "--interface", "documented"], "invalid choice"),
    (["{}", "--yes"], "--yes is for --write"), (["{}", "--ip", '1.2"/><node'], "no IP address"),
    (["{}/none"], "is not there"), ([], "required")])
def test_wrong_usage_is_2(words, why, tmp_path, capsys):
    try:
        code = main([word.format(tmp_path) for word in words])
    except SystemExit as end:
        code = end.code
    assert code == 2 and why in capsys.readouterr().err


def test_elements_are_found_at_their_bytes_behind_a_mark_and_in_words_of_any_language():
    text = "\ufeff<launch><!-- 机器人 --><arg name='说' default=\"a>b\"/></launch>".encode()
    root, arg = elements(text)
    assert text[arg.begin:arg.head_end].decode() == "<arg name='说' default=\"a>b\"/>" and arg.parent is root
    assert arg.get("default") == "a>b" and arg.get("name") == "说" and text[root.close:] == b"</launch>"
    with pytest.raises(UnreadableLaunchFile, match="line 1, column 9"):
        elements(b"<launch>\n"[:-1] + b"&x;")


def test_the_command_runs_without_ros_and_a_reader_may_have_enough(tmp_path):
    (tmp_path / "a.launch").write_bytes(INCLUDE)
    (tmp_path / "many.py").write_text('"/jaka_driver/jog"\n' * 20000)
    words = command_of("migrate_cell")
    environment = {"PATH": os.environ["PATH"], "LANG": "C", "PYTHONPATH": os.environ.get("PYTHONPATH", "")}
    done = subprocess.run("%s %s | head -n 2; echo ${PIPESTATUS[0]}" % (" ".join(words), tmp_path), shell=True,
                          executable="/bin/bash", env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          text=True, timeout=60)
    assert "Traceback" not in done.stdout, done.stdout
    assert done.stdout.startswith("2 launch files and source files read"), done.stdout
    assert done.stdout.splitlines()[-1] == "1"
