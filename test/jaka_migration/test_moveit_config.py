"""The check of MoveIt configurations: packages with the maker's names and values, a cell's own, each fault alone."""
import json
import os
import re
import shutil
import subprocess

import moveit_packages
import pytest
from command_places import command_of
from import_graph import ROOT, outside_imports
from moveit_packages import ARMS, JOINTS, fitting, makers, urdf_of, write

from jaka_migration import launch_files
from jaka_migration.moveit_config import check, main
from jaka_migration.report import ADVICE, FITS, MUST_CHANGE, NOT_READ, SECTIONS
from jaka_ros_driver.kinematics.arm_models import load_model, model_names
from jaka_ros_driver.kinematics.urdf import urdf_from_model

ALL = ", ".join(JOINTS)


def lines(report, section):
    return ["%s: %s" % (finding.place, finding.text) for finding in report.of(section)]


def found(report, section, pattern):
    return [line for line in lines(report, section) if re.search(pattern, line)]


# ---- the maker's packages ----

@pytest.mark.parametrize("model, base, flange", [
    ("zu7", "Link_0", "Link_6"), ("a5", "base_link", "J6"), ("pro7", "base_link", "Link_6")])
def test_of_the_makers_packages_only_the_demo_must_change(tmp_path, model, base, flange):
    report = check(str(makers(tmp_path, model)))
    assert report.model.startswith(model + " (guessed from the folder's name")
    line, = lines(report, MUST_CHANGE)
    assert line.startswith("launch/demo.launch:3: starts joint_state_publisher") and report.exit_code == 1
    assert found(report, FITS, "^config/ros_controllers.yaml:5: controller jaka_%s_controller" % model)
    chain, = found(report, FITS, "the chain from %s to %s differs from model %s by" % (base, flange, model))
    assert float(re.search(r"([\d.]+) mm", chain).group(1)) < 0.5
    assert found(report, ADVICE, "~base_frame to %s and ~flange_frame to %s" % (base, flange))
    assert found(report, ADVICE, "jaka_planner/launch/moveit_server.launch:3: starts the maker's moveit_server")
    assert found(report, ADVICE, "no acceleration limit for %s" % ALL)
    assert found(report, ADVICE, "monitoring is on, with scaling 5 and margin 0.5 s")
    assert found(report, ADVICE, "fake_moveit_controller_manager.launch.xml:2: .*does not lead to the driver")
    assert report.of(NOT_READ) == []


def test_a_limit_that_is_rounded_up_is_pointed_out(tmp_path):
    line, = found(check(str(makers(tmp_path, "a5"))), ADVICE, "joint_2: range")
    assert "4.628" in line and "4.6251" in line and "the last 0.0029 rad" in line


def test_continuous_joints_must_change_and_a_base_below_a_fixed_joint_is_found(tmp_path):
    report = check(str(makers(tmp_path, "zu12")))
    assert len(found(report, MUST_CHANGE, "joint_[1-6] is continuous")) == 6
    assert found(report, ADVICE, "~base_frame to world and ~flange_frame to Link_6")


# ---- the chain ----

@pytest.mark.parametrize("model", model_names())
def test_the_drivers_own_urdf_fits_its_model(tmp_path, model):
    package = fitting(tmp_path)
    write(package, {"config/press.urdf": urdf_from_model(load_model(model))})
    report = check(str(package), model_name=model)
    assert found(report, FITS, r"the chain from base_link to tool0 differs from model %s by 0\.00 mm" % model)


def test_another_model_than_the_urdfs_is_found_with_the_nearest(tmp_path):
    report = check(str(makers(tmp_path, "zu7")), model_name="zu5")
    line, = found(report, MUST_CHANGE, "the chain from")
    assert float(re.search(r"by ([\d.]+) mm", line).group(1)) > 100 and "nearest is model zu7, 0.03 mm" in line
    assert found(report, MUST_CHANGE, "controller jaka_zu7_controller: .* is below jaka_zu5_controller")
    assert not found(report, ADVICE, "~flange_frame")


@pytest.mark.parametrize("joint, origin, told", [
    (1, (0.00941, 0, 0.12015), r"same arm with the frame of Link_0 moved by 9\.4, 0\.0, 0\.0 mm: correct"),
    (6, (0, 0.1370, 0), r"same arm with the frame of Link_6 moved by 0\.0, 0\.0, 30\.0 mm: correct"),
    (6, (0, 0.1175, 0), r"by 10\.5\d mm.*; nearest is model s7")])
def test_a_frame_that_is_only_moved_is_told_from_another_arm(tmp_path, joint, origin, told):
    origins = list(ARMS["zu7"].origins)
    origins[joint - 1] = origin
    package = makers(tmp_path, "zu7")
    write(tmp_path, {"jaka_description/urdf/jaka_zu7.urdf": urdf_of(ARMS["zu7"]._replace(origins=origins))})
    assert found(check(str(package)), MUST_CHANGE, told)


def test_a_flange_frame_that_is_only_turned_is_told_in_degrees(tmp_path):
    # as the maker's URDF of the s7 has it: half a turn about the flange's axis
    package = makers(tmp_path, "zu7")
    urdf = tmp_path / "jaka_description" / "urdf" / "jaka_zu7.urdf"
    urdf.write_text(urdf.read_text().replace('rpy="-1.5708 0 0"', 'rpy="-1.5708 3.14159 0"'))
    line, = found(check(str(package)), MUST_CHANGE, "the chain from Link_0 to Link_6")
    assert "by 0.03 mm and 180.00 deg" in line
    assert re.search(r"the same arm with the frame of Link_6 turned by 0\.0, 0\.0, -?180\.0 deg about x, y, z: ", line)


def test_a_base_frame_that_is_moved_by_little_is_told_in_mm(tmp_path):
    # as the maker's URDF of the zu20 has it
    package = makers(tmp_path, "zu7")
    origins = [(0.0044, -0.0003, 0.12015), *ARMS["zu7"].origins[1:]]
    write(tmp_path, {"jaka_description/urdf/jaka_zu7.urdf": urdf_of(ARMS["zu7"]._replace(origins=origins))})
    line, = found(check(str(package)), ADVICE, "the chain from")
    assert re.search(r"the same arm with the frame of \w+ moved by 4\.4, -0\.3, 0\.0 mm: compare a pose", line)


def test_without_a_name_the_model_is_the_one_of_the_urdf(tmp_path, capsys):
    package = fitting(tmp_path, "zu12")
    controllers = package / "config" / "controllers.yaml"
    controllers.write_text(controllers.read_text().replace("jaka_zu12_controller", "arm"))
    (package / "config" / "press.srdf").write_text(moveit_packages.srdf_of(ARMS["zu12"]._replace(robot="press"), "arm"))
    (package / "config" / "press.urdf").write_text(urdf_of(ARMS["zu12"]._replace(robot="press", type="revolute")))
    report = check(str(package), controller="arm")
    assert re.match(r"(zu|pro|c)12 \(guessed from the URDF's chain", report.model) and report.exit_code == 0
    (package / "config" / "press.urdf").unlink()
    assert main([str(package)]) == 2
    assert re.search("error: .*no name in it speaks of a model.*give --model, one of zu3", capsys.readouterr().err)


# ---- one fault each ----

def test_a_package_that_fits_needs_no_change(tmp_path):
    report = check(str(fitting(tmp_path)))
    assert lines(report, MUST_CHANGE) == lines(report, NOT_READ) == [] and report.exit_code == 0


C, L, S, U, X = ("config/controllers.yaml", "config/joint_limits.yaml", "config/press.srdf", "config/press.urdf",
                 "launch/press.launch")
FAULTS = [
    (C, "follow_joint_trajectory", "joint_trajectory", MUST_CHANGE, "^%s:6: .*must be follow_joint_trajectory" % C),
    (C, "type: Follow", "type: Gripper", MUST_CHANGE, "^%s:7: .*type is 'GripperJointTrajectory'" % C),
    (C, "default: true", "default: false", ADVICE, "^%s:8: .*default: true" % C),
    (C, "jaka_zu7_controller", "arm_controller", MUST_CHANGE, "^%s:5: .*~trajectory_controller to arm_controller" % C),
    (C, "- joint_2", "- Joint_2", MUST_CHANGE, "^%s:10: .*not the driver's: Joint_2; missing: joint_2" % C),
    (C, "- joint_2", "- joint_1", MUST_CHANGE, "missing: joint_2; twice: joint_1"),
    (C, "- joint_1\n      - joint_2", "- joint_2\n      - joint_1", ADVICE, "joints are in the order joint_2, joint_1"),
    (C, "- joint_", "- left_joint_", MUST_CHANGE, "~frame_prefix to 'left_'"),
    (C, "controller_list:", "controllers:", MUST_CHANGE, "no controller_list"),
    (C, "controller_list:", "a: &a [1, *a]\ncontroller_list:", ADVICE, "ros_control"),
    (L, "joint_3:", "Joint3:", MUST_CHANGE, "^%s:12: Joint3 is no joint of the driver.*write joint_3" % L),
    (L, "max_velocity: 1.5", "max_velocity: 3.3", MUST_CHANGE, "^%s:4: joint_1: max_velocity is 3.3 rad/s" % L),
    (L, "max_velocity: 1.5", "max_velocity: !degrees 190", MUST_CHANGE, "joint_1: max_velocity is 3.31613"),
    (L, "max_velocity: 1.5", "max_velocity: .nan", MUST_CHANGE, "'.nan', no finite number"),
    (L, "max_acceleration: 1", "max_acceleration: 15", MUST_CHANGE, r"^%s:6: .*is 15 rad/s2.*12.57 .*\(720 deg" % L),
    (L, "max_acceleration: 1", "max_acceleration: 0", MUST_CHANGE, "must be above 0"),
    (L, "max_velocity: 1.5", "has_position_limits: true\n    max_position: 7", MUST_CHANGE, "range -6.28 to 7 rad"),
    (L, "max_velocity: 1.5", "min_position: -7", MUST_CHANGE, "^%s:4: joint_1: range -7 to 6.28 rad" % L),
    (L, "has_velocity_limits: true\n    max_velocity: 1.5", "max_velocity: 30", MUST_CHANGE, "velocity is 30 rad/s"),
    (L, "has_acceleration_limits: true\n    max_acceleration: 1", "max_acceleration: 15", MUST_CHANGE, "is 15 rad/s2"),
    (S, 'name="joint_4"/>\n    <', 'name="joint_44"/>\n    <', MUST_CHANGE, "^%s:7: names joint joint_44" % S),
    (S, 'link1="Link_0"', 'link1="base"', MUST_CHANGE, "names link base, which the URDF does not have; it has Link_0"),
    (S, 'robot name="jaka_zu7"', 'robot name="other"', ADVICE, "robot 'other', but the URDF's is 'jaka_zu7'"),
    (S, "</robot>", '<virtual_joint name="v" type="fixed" child_link="Link_0"/></robot>', MUST_CHANGE,
     "child_link is Link_0; it must be the URDF's root, world"),
    (S, "</robot>", '<virtual_joint name="v" type="floating" child_link="world"/></robot>', MUST_CHANGE,
     "virtual joint v is floating"),
    (U, 'upper="6.28"', 'upper="7"', MUST_CHANGE, "^%s:.*joint_1: range -6.28 to 7 rad.*refuses plans beyond" % U),
    (U, 'name="joint_6" type="revolute"', 'name="wrist" type="revolute"', MUST_CHANGE, "has no joint joint_6"),
    (U, '<parent link="Link_1"/><child link="Link_2"/>', '<parent link="world"/><child link="Link_2"/>', MUST_CHANGE,
     "its joints follow each other as"),
    (U, 'xyz="0.36 0 0"', 'xyz="0.36 0 nan"', NOT_READ, "must be three numbers"),
    (X, 'monitoring" value="false"', 'monitoring" value="true"', MUST_CHANGE, "with scaling 1.2 and margin 0.5 s"),
    (X, "moveit_simple_controller_manager/MoveIt", "moveit_fake_controller_manager/MoveIt", MUST_CHANGE,
     "^%s:3: moveit_controller_manager is moveit_fake" % X),
    (X, "</launch>", '<param name="trajectory_execution/allowed_start_tolerance" value="0.05"/></launch>', ADVICE,
     "0.05 rad does not help"),
    (X, "</launch>", '<arg name="fake_execution" default="true"/></launch>', MUST_CHANGE, "no plan would reach"),
    (X, "</launch>", '<param name="model" value="zu5"/><node pkg="jaka_planner" type="moveit_server"/></launch>',
     MUST_CHANGE, "maker's moveit_server.*its model is zu5, not zu7"),
    (X, "</launch>", '<node pkg="joint_state_publisher_gui"/></launch>', ADVICE, "for a demo without arm"),
    (X, "</launch>", '<param name="trajectory_execution/allowed_start_tolerance" value="$(arg t)"/></launch>', NOT_READ,
     "decided elsewhere"),
]


# what launch files name; roslaunch of ROS Noetic refuses, or leaves out, each of these
FIND = "$(find press_moveit_config)/"
FAULTS += [
    (X, "</launch>", '<rosparam file="%sconfig/gone.yaml"/></launch>' % FIND, MUST_CHANGE,
     "^%s:5: names config/gone.yaml, which is not there" % X),
    (X, "</launch>", '<arg name="db" default="false"/><include if="$(arg db)" file="%slaunch/gone.launch"/></launch>'
     % FIND, FITS, "monitoring is off"),
    (X, "</launch>", '<arg name="a" default="x"/><include file="%slaunch/$(arg a).launch"/></launch>' % FIND,
     MUST_CHANGE, "names launch/x.launch, which is not there"),
    (X, "</launch>", '<include file="%slaunch/press.launch"><arg name="speed" value="1"/></include></launch>' % FIND,
     MUST_CHANGE, "gives launch/press.launch the argument speed, which it does not have"),
    (X, "</launch>", '<arg name="t"/><param name="t" value="$(arg t)"/><include file="%slaunch/press.launch"/></launch>'
     % FIND, MUST_CHANGE, "does not give launch/press.launch the argument t, which it needs"),
    (X, "</launch>", '<arg name="t"/><include file="%slaunch/press.launch" pass_all_args="true"/></launch>' % FIND,
     FITS, "monitoring is off"),
    (X, "</launch>", '<include file="$(find a)/b"><param name="c" value="1"/></include></launch>', ADVICE,
     "^%s:5: <param> within <include>: roslaunch leaves it out" % X),
    (X, "</launch>", '<param name="d" textfile="$(find jaka_description)/urdf/jaka_zu5.urdf"/></launch>', MUST_CHANGE,
     "names the description of another arm, urdf/jaka_zu5.urdf"),
    (X, "</launch>", '<include file="$(find jaka_driver)/launch/robot_start_launch.launch"/></launch>', MUST_CHANGE,
     "^%s:5: starts the maker's driver" % X),
    (X, "</launch>", '<include file="$(find jaka_planner)/launch/moveit_server.launch"/></launch>', MUST_CHANGE,
     "^%s:5: starts the maker's driver or MoveIt server" % X),
    (X, "</launch>", '<arg name="g" default="false"/><node pkg="joint_state_publisher_gui" if="$(arg g)"/></launch>',
     ADVICE, "starts joint_state_publisher .if .* by default not"),
    (C, "controller_list:", "jaka_zu7_controller:\n  constraints: {goal_time: 0.6}\ncontroller_list:", ADVICE,
     "^%s:5: constraints of jaka_zu7_controller" % C),
    (C, "controller_list:", "controller_list:", ADVICE, "^%s: no launch file of the package loads it" % C),
]


@pytest.mark.parametrize("file, old, new, section, told", FAULTS, ids=[str(n) for n in range(len(FAULTS))])
def test_a_fault_is_told_with_its_line(tmp_path, file, old, new, section, told):
    package = fitting(tmp_path)
    text = (package / file).read_text()
    assert old in text
    once = "left_" not in new
    (package / file).write_text(text.replace(old, new, 1) if once else text.replace(old, new))
    report = check(str(package))
    assert found(report, section, told), report.as_text()
    assert (report.exit_code == 1) is (bool(lines(report, MUST_CHANGE)))


def test_a_bound_of_the_file_leaves_the_other_one_to_the_urdf(tmp_path):
    # as MoveIt 1 reads them: each for itself, whatever has_position_limits says
    package = fitting(tmp_path)
    urdf = package / U
    urdf.write_text(urdf.read_text().replace('lower="-6.28"', 'lower="-12"', 1))
    limits = (package / L).read_text()
    (package / L).write_text(limits.replace("  joint_1:\n", "  joint_1:\n    max_position: 1.5\n"))
    report = check(str(package))
    assert found(report, MUST_CHANGE, "^%s:3: joint_1: range -12 to 1.5 rad" % L), report.as_text()
    assert found(report, FITS, "^%s: limits of joint_2, " % U)
    (package / L).write_text(limits.replace("  joint_1:\n", "  joint_1:\n    max_position: 1.5\n    min_position: -1\n"
                                            "    has_position_limits: false\n"))
    report = check(str(package))
    assert report.exit_code == 0 and found(report, FITS, "^%s: limits of joint_1, " % U), report.as_text()


MANAGER = '<param name="move_group/moveit_controller_manager" value="%s"/>'
SIMPLE = MANAGER % launch_files.SIMPLE_MANAGER
FAKE = MANAGER % "moveit_fake_controller_manager/MoveItFakeControllerManager"
MONITORING = '<param name="trajectory_execution/execution_duration_monitoring" value="%s"/>'
OFF = MONITORING % "false"
SIM = '<arg name="sim" default="true"/>'


@pytest.mark.parametrize("text, section, told", [
    (SIM + '<group unless="$(arg sim)">%s</group>' % OFF + SIMPLE, MUST_CHANGE, "monitoring is on, with scaling 1.2"),
    (OFF + '<group if="false"><group>%s</group></group>' % SIMPLE, MUST_CHANGE, "no launch file sets moveit_cont"),
    (OFF + '<group if="false">%s</group><group>%s</group>' % (SIMPLE, FAKE), MUST_CHANGE, "manager is moveit_fake"),
    (SIM + '<arg name="mon" value="false" unless="$(arg sim)"/><arg name="mon" value="true" if="$(arg sim)"/>'
     + MONITORING % "$(arg mon)" + SIMPLE, MUST_CHANGE, "monitoring is on"),
    (SIM + '<group unless="$(arg sim)"><arg name="m" value="false"/></group><group><arg name="m" value="true"/></group>'
     + MONITORING % "$(arg m)" + SIMPLE, MUST_CHANGE, "monitoring is on"),
    ('<arg name="sim"/><arg name="m" value="%s" unless="$(arg sim)"/><arg name="m" value="fake" if="$(arg sim)"/>'
     % launch_files.SIMPLE_MANAGER + OFF + MANAGER % "$(arg m)", NOT_READ, "is '.*arg m.*', which is decided"),
    (OFF + SIMPLE + '<group if="0"><node pkg="joint_state_publisher"><param name="source_list" value="joint_states"/>'
     "</node></group>", ADVICE, "starts joint_state_publisher, by default not")])
def test_what_a_condition_leaves_out_is_not_taken_for_set(tmp_path, text, section, told):
    package = fitting(tmp_path)
    (package / X).write_text("<launch>%s</launch>" % text)
    report = check(str(package))
    assert found(report, section, told), report.as_text()
    assert (report.exit_code == 1) is bool(lines(report, MUST_CHANGE)) is (section == MUST_CHANGE)


def test_the_simulation_of_another_arm_is_advice_and_a_file_that_a_demo_lacks_too(tmp_path):
    package = fitting(tmp_path)
    write(package, {"launch/gazebo.launch": '<launch><arg name="urdf" default="$(find jaka_description)/urdf/'
                    'jaka_zu5.urdf"/></launch>',
                    "launch/demo.launch": '<launch><include file="%slaunch/moveit_rviz.launch"/></launch>' % FIND})
    report = check(str(package))
    assert found(report, ADVICE, "^launch/gazebo.launch:1: names the description of another arm, urdf/jaka_zu5.urdf")
    assert found(report, ADVICE, "^launch/demo.launch:1: names launch/moveit_rviz.launch")
    assert lines(report, MUST_CHANGE) == []


def test_a_prefix_that_the_driver_has_too_fits(tmp_path):
    package = fitting(tmp_path)
    for path in (package / "config").iterdir():
        path.write_text(re.sub(r"\b(joint_[1-6]|Link_\d)\b", r"left_\1", path.read_text()))
    report = check(str(package), frame_prefix="left_")
    assert lines(report, MUST_CHANGE) == []
    assert found(report, ADVICE, "~base_frame to Link_0 and ~flange_frame to Link_6")


def test_a_gripper_beside_the_arm_is_left_alone(tmp_path):
    package = fitting(tmp_path)
    with (package / C).open("a") as file:
        file.write("  - name: hand\n    joints: [finger_joint_1, finger_joint1]\n")
    report = check(str(package))
    assert report.exit_code == 0 and found(report, ADVICE, "controller hand has no joint of the arm")


def test_a_configuration_of_moveit_2_is_told(tmp_path):
    package = fitting(tmp_path)
    (package / C).unlink()
    write(package, {"launch/demo.launch.py": "raise SystemExit", "config/moveit_controllers.yaml":
                    "moveit_simple_controller_manager:\n  controller_names: [jaka_zu7_controller]\n"
                    "  jaka_zu7_controller:\n    type: FollowJointTrajectory\n    default: true\n"
                    "    action_ns: follow_joint_trajectory\n    joints: [%s]\n" % ALL})
    report = check(str(package))
    line, = lines(report, MUST_CHANGE)
    assert line.startswith("config/moveit_controllers.yaml:2: is in the form of MoveIt 2")
    assert found(report, NOT_READ, "launch/demo.launch.py: is Python code")


def test_the_layout_of_the_setup_assistant_fits(tmp_path):
    # MoveIt 1.1: a demo with fake controllers beside managers by name, groups by chain
    package = fitting(tmp_path)
    (package / C).rename(package / "config" / "simple_moveit_controllers.yaml")
    (package / X).unlink()
    srdf = package / S
    chain = r'\1<chain base_link="Link_0" tip_link="Link_6"/></group>'
    srdf.write_text(re.sub("(?s)(<group name.*?>).*?</group>", chain, srdf.read_text(), count=1))
    files = {name: '<param name="moveit_controller_manager" value="%s"/>' % plugin for name, plugin in (
        ("simple_moveit_controller_manager.launch.xml", launch_files.SIMPLE_MANAGER),
        ("fake_moveit_controller_manager.launch.xml", "moveit_fake_controller_manager/MoveItFakeControllerManager"),
        ("ros_control_moveit_controller_manager.launch.xml", "moveit_ros_control_interface::MoveItControllerManager"))}
    files["move_group.launch"] = '<arg name="moveit_controller_manager" default="simple"/>'
    files["demo.launch"] = (
        '<arg name="moveit_controller_manager" default="fake"/><node pkg="joint_state_publisher" type="x"/>')
    files["execution.launch.xml"] = '<param name="trajectory_execution/execution_duration_monitoring" value="false"/>'
    write(package, {"launch/" + name: "<launch>%s</launch>" % text for name, text in files.items()})
    report = check(str(package))
    assert lines(report, MUST_CHANGE) == [] and found(report, FITS, "group arm has the arm's six joints")
    assert len(found(report, ADVICE, "does not lead to the driver")) == 2
    write(package, {"launch/move_group.launch":
                    '<launch><arg name="moveit_controller_manager" default="ros_control"/></launch>'})
    line, = lines(check(str(package)), MUST_CHANGE)
    assert line.startswith("launch/ros_control_moveit_controller_manager.launch.xml:1: moveit_controller_manager is")


def test_of_a_xacro_file_is_said_that_it_was_not_read(tmp_path):
    package = makers(tmp_path, "zu7")
    urdf = tmp_path / "jaka_description" / "urdf" / "jaka_zu7.urdf"
    planning = package / "launch" / "planning_context.launch"
    planning.write_text('<launch><param name="robot_description" command="xacro '
                        "'$(find jaka_description)/urdf/jaka_zu7.urdf.xacro'\"/></launch>")
    urdf.rename(str(urdf) + ".xacro")
    report = check(str(package))
    assert found(report, NOT_READ, "jaka_zu7.urdf.xacro: is a xacro file: nothing is run here")
    assert not found(report, FITS, "chain")
    shutil.copy(str(urdf) + ".xacro", str(tmp_path / "written.urdf"))
    assert found(check(str(package), urdf_path=str(tmp_path / "written.urdf")), FITS, "chain")


def test_the_drivers_start_tolerance_is_the_one_of_its_parameter():
    row, = re.findall(r"^\| `~trajectory_start_tolerance` \|.*`([\d.]+)`", (
        ROOT / "docs" / "parameters.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert float(row) == launch_files.START_TOLERANCE_RAD


# ---- the program ----

def test_the_command_prints_its_list_for_people_and_for_scripts(tmp_path):
    package = makers(tmp_path, "zu7")
    words = [*command_of("check_moveit_config"), str(package)]
    done = subprocess.run(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=100)
    assert done.returncode == 1
    assert re.findall(r"^(fits|must change|advice|not read) \(\d+\)$", done.stdout, re.MULTILINE) == list(SECTIONS[:3])
    done = subprocess.run([*words, "--json"], stdout=subprocess.PIPE, timeout=100)
    answer = json.loads(done.stdout)
    assert answer["exit_code"] == done.returncode == 1 and answer["not_read"] == []
    assert (answer["must_change"][0]["file"], answer["must_change"][0]["line"]) == ("launch/demo.launch", 3)


def test_a_report_that_cannot_be_written_is_a_failure_and_one_that_is_cut_is_none(tmp_path):
    words = [*command_of("check_moveit_config"), str(fitting(tmp_path))]
    with open("/dev/full", "w") as full:
        done = subprocess.run(words, stdout=full, stderr=subprocess.PIPE, text=True, timeout=100)
    assert done.returncode == 2 and "the report cannot be written: No space left" in done.stderr
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run(words, stdout=writing, stderr=subprocess.PIPE, text=True, timeout=100)
    os.close(writing)
    assert (done.returncode, done.stderr) == (0, "")


def test_the_command_of_the_page_runs(tmp_path):
    page = (ROOT / "docs" / "moveit.md").read_text(encoding="utf-8")
    command, = re.findall(r"^rosrun jaka_ros_driver (check_moveit_config .+)$", page, re.MULTILINE)
    program, *words = command.split()
    makers(tmp_path / "src", "zu7")
    done = subprocess.run([*command_of(program), *words], cwd=str(tmp_path), stdout=subprocess.PIPE, text=True,
                          timeout=100)
    assert done.returncode == 1 and "must change (1)\n  - launch/demo.launch" in done.stdout


def test_it_needs_no_ros():
    assert "rospy" not in outside_imports("jaka_migration.moveit_config")


@pytest.mark.parametrize("words, told", [
    (["{0}/none"], "none: is not there"), (["{0}/file"], "file: is no folder"),
    (["{0}"], "holds no MoveIt configuration"),
    (["{0}/press_moveit_config", "--model", "zu77"], "unknown arm model 'zu77'; nearest is 'zu7'"),
    (["{0}/press_moveit_config", "--dh-file", "{0}/none"], "cannot be read")])
def test_wrong_usage_is_one_line(tmp_path, capsys, words, told):
    fitting(tmp_path)
    (tmp_path / "file").write_text("")
    assert main([word.format(tmp_path) for word in words]) == 2
    said = capsys.readouterr().err
    assert told in said and said.count("\n") == 1 and said.startswith("check_moveit_config: error: ")
