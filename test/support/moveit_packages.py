"""MoveIt configuration packages for tests: of our own making, with the names and values of the maker's as facts.

Source of the facts: github.com/JakaCobot/jaka_robot, folder jaka_robot_v2.2/src, jaka_<model>_moveit_config and
jaka_description of zu7, a5, pro7 and zu12, as read in November 2026; none of their text is here.
"""
from pathlib import Path
from typing import Dict, List, NamedTuple, Optional, Sequence, Tuple

RIGHT = 1.5708
RANGES = [(-6.28, 6.28), (-1.48, 4.62), (-3.05, 3.05), (-1.48, 4.62), (-6.28, 6.28), (-6.28, 6.28)]
JOINTS = ["joint_%d" % n for n in range(1, 7)]


class Arm(NamedTuple):
    """The facts of one description.

    Attributes:
        robot: The robot's name in URDF and SRDF.
        urdf: The URDF's file name.
        links: Base, then the links behind joints 1 to 6.
        origins: xyz of the joints' origins, m.
        speed: The joints' velocity limit, rad/s.
        base_z: Height of the fixed joint under the base, m.
        type: The joints' type.
        ranges: The joints' limits, rad.
    """

    robot: str
    urdf: str
    links: Sequence[str]
    origins: Sequence[Tuple[float, float, float]]
    speed: float = 3.14
    base_z: float = 0.0
    type: str = "revolute"
    ranges: Sequence[Tuple[float, float]] = tuple(RANGES)


def links(base: str, name: str) -> List[str]:
    return [base, *(name % n for n in range(1, 7))]


ARMS: Dict[str, Arm] = {
    "zu7": Arm("jaka_zu7", "jaka_zu7.urdf", links("Link_0", "Link_%d"), [
        (0, 0, 0.12015), (0, 0, 0), (0.36, 0, 0), (0.30353, 0, -0.11501), (0, -0.1135, 0), (0, 0.107, 0)]),
    "a5": Arm("jaka_a5", "jaka_a5.urdf", links("base_link", "J%d"), [
        (0, -0.00022535, 0.12015), (0, 0, 0), (0.43, 0, 0), (0.3685, 0, -0.115), (0, -0.1135, 0), (0, 0.107, 0)],
        speed=3.665, ranges=[RANGES[0], (-1.48, 4.628), *RANGES[2:]]),
    "pro7": Arm("Pro 7.SLDASM", "jaka_Pro 7.urdf", links("base_link", "Link_%d"), [
        (0, 0, 0.12015), (0, 0, 0), (0.36, 0, 0), (0.3035, 0, -0.11502), (0, -0.1135, 0), (0, 0.107, 0)]),
    "zu12": Arm("jaka_zu12", "jaka_zu12.urdf", links("Link_0", "Link_%d"), [
        (0, 0, 0.10265), (0, 0, 0), (0.595, 0, 0), (0.5715, 0, -0.1315), (0, -0.115, 0), (0, 0.1035, 0)],
        speed=2.09, base_z=0.04, type="continuous"),
}
TURNS = [0, RIGHT, 0, 0, RIGHT, -RIGHT]


def urdf_of(arm: Arm) -> str:
    """Return a URDF without shapes."""
    lines = ['<robot name="%s">' % arm.robot, '<link name="world"/>']
    lines += ['<link name="%s"/>' % link for link in arm.links]
    lines += ['<joint name="fixed" type="fixed">', '  <origin xyz="0 0 %g"/>' % arm.base_z,
              '  <parent link="world"/><child link="%s"/>' % arm.links[0], "</joint>"]
    for name, parent, child, origin, turn, (low, high) in zip(
            JOINTS, arm.links, arm.links[1:], arm.origins, TURNS, arm.ranges):
        lines += ['<joint name="%s" type="%s">' % (name, arm.type),
                  '  <origin xyz="%g %g %g" rpy="%g 0 0"/>' % (*origin, turn),
                  '  <parent link="%s"/><child link="%s"/><axis xyz="0 0 1"/>' % (parent, child),
                  '  <limit lower="%g" upper="%g" effort="1000" velocity="%g"/>' % (low, high, arm.speed), "</joint>"]
    return "\n".join(lines + ["</robot>"]) + "\n"


def srdf_of(arm: Arm, group: str) -> str:
    lines = ['<robot name="%s">' % arm.robot, '  <group name="%s">' % group]
    lines += ['    <joint name="%s"/>' % name for name in ["fixed", *JOINTS]] + ["  </group>"]
    lines += ['  <group_state name="zero" group="%s">' % group]
    lines += ['    <joint name="%s" value="0"/>' % name for name in JOINTS] + ["  </group_state>"]
    lines += ['  <disable_collisions link1="%s" link2="%s" reason="Adjacent"/>' % pair
              for pair in zip(arm.links, arm.links[1:])]
    return "\n".join(lines + ["</robot>"]) + "\n"


def controllers_of(name: str, joints: Sequence[str] = tuple(JOINTS)) -> str:
    rows = "".join("      - %s\n" % joint for joint in joints)
    return ("joint_state_controller:\n  type: joint_state_controller/JointStateController\n  publish_rate: 50\n"
            "controller_list:\n  - name: %s\n    action_ns: follow_joint_trajectory\n    type: FollowJointTrajectory\n"
            "    default: true\n    joints:\n%s" % (name, rows))


def limits_of(speed: Optional[float], acceleration: Optional[float]) -> str:
    rows = ["joint_limits:"]
    for name in JOINTS:
        rows += ["  %s:" % name, "    has_velocity_limits: %s" % ("true" if speed else "false"),
                 "    max_velocity: %g" % (speed or 0),
                 "    has_acceleration_limits: %s" % ("true" if acceleration else "false"),
                 "    max_acceleration: %g" % (acceleration or 0)]
    return "\n".join(rows) + "\n"


def makers(folder: Path, model: str) -> Path:
    """Write a package as the maker publishes it, with its description beside it; return its folder."""
    arm, name = ARMS[model], "jaka_%s_moveit_config" % model
    package = folder / name
    hears = "/joint_states" if model != "pro7" else "move_group/fake_controller_joint_states"
    files = {
        "config/ros_controllers.yaml": controllers_of("jaka_%s_controller" % model),
        "config/fake_controllers.yaml": "controller_list:\n  - name: fake_jaka_%s_controller\n    "
                                        "type: $(arg execution_type)\n    joints: []\n" % model,
        "config/joint_limits.yaml": limits_of(1.57, None),
        "config/%s.srdf" % arm.robot: srdf_of(arm, "jaka_" + model),
        "launch/planning_context.launch":
            '<launch>\n  <param name="robot_description" textfile="$(find jaka_description)/urdf/%s"/>\n'
            '</launch>\n' % arm.urdf,
        "launch/move_group.launch":
            '<launch>\n  <arg name="fake_execution" default="false"/>\n'
            '  <include ns="move_group" file="$(find %s)/launch/trajectory_execution.launch.xml">\n'
            '    <arg name="moveit_controller_manager" value="jaka_%s" unless="$(arg fake_execution)"/>\n'
            '    <arg name="moveit_controller_manager" value="fake" if="$(arg fake_execution)"/>\n'
            '  </include>\n</launch>\n' % (name, model),
        "launch/trajectory_execution.launch.xml":
            '<launch>\n  <param name="trajectory_execution/allowed_execution_duration_scaling" value="5"/>\n'
            '  <param name="trajectory_execution/allowed_goal_duration_margin" value="0.5"/>\n'
            '  <param name="trajectory_execution/allowed_start_tolerance" value="0.01"/>\n'
            '  <arg name="moveit_controller_manager" default="jaka_%s"/>\n</launch>\n' % model,
        "launch/jaka_%s_moveit_controller_manager.launch.xml" % model:
            '<launch>\n  <arg name="moveit_controller_manager"\n'
            '       default="moveit_simple_controller_manager/MoveItSimpleControllerManager"/>\n'
            '  <param name="moveit_controller_manager" value="$(arg moveit_controller_manager)"/>\n</launch>\n',
        "launch/fake_moveit_controller_manager.launch.xml":
            '<launch>\n  <param name="moveit_controller_manager"\n'
            '         value="moveit_fake_controller_manager/MoveItFakeControllerManager"/>\n</launch>\n',
        "launch/ros_controllers.launch":
            '<launch>\n  <node name="controller_spawner" pkg="controller_manager" type="spawner"/>\n</launch>\n',
        "launch/demo.launch":
            '<launch>\n  <arg name="use_gui" default="false"/>\n'
            '  <node name="joint_state_publisher" pkg="joint_state_publisher" type="joint_state_publisher"\n'
            '        unless="$(arg use_gui)">\n    <rosparam param="source_list">[%s]</rosparam>\n  </node>\n'
            '  <node name="robot_state_publisher" pkg="robot_state_publisher" type="robot_state_publisher"/>\n'
            '  <include file="$(find %s)/launch/move_group.launch">\n'
            '    <arg name="fake_execution" value="false"/>\n  </include>\n</launch>\n' % (hears, name),
    }
    write(package, files)
    write(folder, {"jaka_description/urdf/" + arm.urdf: urdf_of(arm), "jaka_planner/launch/moveit_server.launch":
                   '<launch>\n  <param name="model" value="$(arg model)"/>\n'
                   '  <node pkg="jaka_planner" type="moveit_server" name="moveit_server"/>\n</launch>\n'})
    return package


def fitting(folder: Path, model: str = "zu7") -> Path:
    """Write a cell's own package that needs no change; return its folder."""
    package = folder / "press_moveit_config"
    write(package, {
        "config/controllers.yaml": controllers_of("jaka_%s_controller" % model),
        "config/joint_limits.yaml": limits_of(1.5, 1.0),
        "config/press.srdf": srdf_of(ARMS[model], "arm"),
        "config/press.urdf": urdf_of(ARMS[model]._replace(type="revolute")),
        "launch/press.launch":
            '<launch>\n  <param name="trajectory_execution/execution_duration_monitoring" value="false"/>\n'
            '  <param name="move_group/moveit_controller_manager"\n'
            '         value="moveit_simple_controller_manager/MoveItSimpleControllerManager"/>\n</launch>\n'})
    return package


def write(folder: Path, files: Dict[str, str]) -> None:
    for name, text in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
