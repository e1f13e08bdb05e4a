"""The launch files: documented arguments, ip alone drives a real arm, the demo, the tree of frames for display."""
import contextlib
import json
import math
import shlex
import shutil
import subprocess
import xml.etree.ElementTree as ElementTree

import pytest
import roslaunch
import roslaunch.arg_dump
import rospy
import std_msgs.msg
import yaml
from diagnostic_msgs.msg import DiagnosticArray
from driver_bench import Arm, SimulatorProcess, collecting
from geometry_msgs.msg import Twist, TwistStamped, Vector3
from import_graph import ROOT
from ros_graph import SYSTEM_PYTHON, Graph
from tf2_msgs.msg import TFMessage
from waiting import eventually
from wire_verdict import WireVerdict

from jaka_ros_driver.client.core.velocity_jog.dead_man import FRESH_S
from jaka_ros_driver.kinematics.arm_models import file_or_none, load_model
from jaka_ros_driver.kinematics.forward import forward
from jaka_ros_driver.kinematics.rotations import IDENTITY, compose, matrix_from_rotation_vector
from jaka_ros_driver.ros.params import DriverConfig, config_from
from jaka_ros_driver.simulation.simulated_controller import SimulatedController

FILES = sorted((ROOT / "launch").glob("*.launch"))
CHECK = "/usr/share/roslaunch/scripts/roslaunch-check"
START = str(ROOT / "launch" / "robot_start_launch.launch")


def nodes(arguments, path=START):
    config = roslaunch.config.load_config_default([(path, arguments)], None, verbose=False)
    return {node.type: node for node in config.nodes}, {key: p.value for key, p in config.params.items()}


def identities(path, *arguments):
    """Return by namespace: the name that a simulated controller is given, and the one that its driver looks for."""
    config = roslaunch.config.load_config_default([(path, arguments)], None, verbose=False)
    words = {node.namespace: node.args.split() for node in config.nodes if node.type == "jaka_sim"}
    assert all(args[-2] == "--identity" for args in words.values()), "behind sim_args: the last one counts"
    return {namespace: (args[-1], config.params[namespace + "jaka_driver/simulator"].value)
            for namespace, args in words.items()}


def test_the_launch_files_are_these():
    assert [path.name for path in FILES] == [
        "arms.launch", "demo.launch", "display.launch", "gamepad.launch", "panel.launch", "robot_start_launch.launch",
        "two_arms.launch"]


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_every_argument_is_documented(path):
    arguments = ElementTree.parse(path).getroot().findall("arg")
    assert arguments and all(argument.get("doc", "").endswith((".", "others (docs/parameters.md).")) and
                             argument.get("default") is not None for argument in arguments)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_roslaunch_lists_no_argument_as_required(path):
    # it takes an argument with an empty default for one
    assert [name for name, (_, default) in roslaunch.arg_dump.get_args([str(path)]).items() if not default] == []


def test_what_one_must_think_about_is_the_table_of_the_page():
    rows = (ROOT / "docs" / "operation.md").read_text(encoding="utf-8").split("| argument | think about |\n")[1]
    four = [row.split("`")[1] for row in rows.split("\n\n")[0].splitlines()[1:]]
    given = roslaunch.arg_dump.get_args([START])
    marked = [name for name, (doc, _) in given.items() if doc.startswith("Think about: ")]
    assert marked == four == list(given)[:4] == ["ip", "model", "dh_file", "auto_enable"]


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_roslaunch_check_has_no_complaint(path, tmp_path):
    done = subprocess.run([SYSTEM_PYTHON, CHECK, "-o", str(tmp_path / "result.xml"), str(path)], text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=60)
    assert done.returncode == 0 and "passed" in done.stdout, done.stdout


@pytest.mark.skipif(shutil.which("rosrun") is None or not subprocess.run(
    ["rospack", "find", "joy"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL).returncode, reason="joy is there")
def test_what_is_not_installed_is_said_and_the_rest_of_the_launch_goes_on(tmp_path):
    with Graph(tmp_path) as graph:
        launched = graph.start("roslaunch", str(ROOT / "launch" / "gamepad.launch"))
        launched.wait()
        assert launched.output.count("not found") >= 1 and "Traceback" not in launched.output, launched.output


@pytest.mark.parametrize("path", ["none", "", "/tmp/my arm.yaml"])
def test_the_simulated_arm_and_the_driver_have_the_same_model_file(path):
    started, params = nodes(["dh_file:=" + path])
    words = shlex.split(started["jaka_sim"].args)
    given = words[words.index("--dh-file") + 1]  # roslaunch leaves out what has no value
    assert file_or_none(given) == params["/jaka_driver/dh_file"] == file_or_none(path)


def test_ip_alone_drives_a_real_arm():
    started, params = nodes(["ip:=10.5.5.100"])
    assert set(started) == {"jaka_driver"}
    assert params["/jaka_driver/ip"] == "10.5.5.100"
    assert (params["/jaka_driver/command_port"], params["/jaka_driver/status_port"]) == (10001, 10000)
    assert params["/jaka_driver/auto_enable"] is True


def test_without_ip_a_simulated_controller_is_started_on_the_ports_of_the_real_one():
    started, params = nodes([])
    assert set(started) == {"jaka_driver", "jaka_sim"}
    assert "--command-port 10001 --status-port 10000" in started["jaka_sim"].args


@pytest.mark.parametrize("name", ["robot_start_launch.launch", "display.launch"])
@pytest.mark.parametrize("sim", ["sim:=true", "sim:=1"])
def test_with_sim_the_simulated_controller_is_driven_whatever_ip_says(name, sim):
    started, params = nodes(["ip:=10.5.5.100", sim], str(ROOT / "launch" / name))
    assert {"jaka_driver", "jaka_sim"} <= set(started)
    assert params["/jaka_driver/ip"] == "127.0.0.1"


@pytest.mark.parametrize("arguments", [[], ["sim:=true", "ip:=10.5.5.100"], ["sim_args:=--identity another"]], ids=str)
def test_driver_and_simulated_controller_share_a_name_that_no_other_launch_has(arguments):
    names = [identities(START, *arguments)["/"] for _ in range(2)]
    assert all(given == sought != "" for given, sought in names)
    assert names[0] != names[1]


def test_each_of_two_arms_has_a_name_of_its_own():
    by_arm = identities(str(ROOT / "launch" / "two_arms.launch"))
    assert set(by_arm) == {"/left/", "/right/"}
    assert all(given == sought for given, sought in by_arm.values())
    assert by_arm["/left/"] != by_arm["/right/"]


def test_arms_of_one_file_each_have_their_parameters_and_nothing_is_powered():
    path = str(ROOT / "launch" / "arms.launch")
    config = roslaunch.config.load_config_default(
        [(path, ["file:=%s" % (ROOT / "docs" / "examples" / "arms.yaml"), "arms:=left right", "black_box:=/boxes"])],
        None, verbose=False)
    params = {key: p.value for key, p in config.params.items()}
    assert {(node.namespace, node.type) for node in config.nodes} == {
        (space, kind) for space in ("/left/", "/right/") for kind in ("jaka_driver", "jaka_bag")}
    assert all(node.required for node in config.nodes if node.type == "jaka_driver")
    assert {node.namespace: node.args.split("'")[1] for node in config.nodes if node.type == "jaka_bag"} == {
        "/left/": "/boxes/left", "/right/": "/boxes/right"}
    for name, ip, model in (("left", "10.5.5.100", "zu7"), ("right", "10.5.5.101", "zu12")):
        own = {key.split("/")[-1]: value for key, value in params.items() if key.startswith("/%s/jaka_driver/" % name)}
        assert (own["ip"], own["model"], own["frame_prefix"]) == (ip, model, name + "_")
        assert own["auto_enable"] is False and own["simulator"] == ""


@pytest.mark.parametrize("arguments", [["ip:=10.5.5.100"], ["sim:=false"], ["sim:=0", "identity:=x"]], ids=str)
def test_without_a_simulated_controller_the_driver_looks_for_none(arguments):
    started, params = nodes(arguments)
    assert set(started) == {"jaka_driver"} and params["/jaka_driver/simulator"] == ""


def test_name_is_one_that_the_simulated_controller_takes():
    given, _ = identities(START)["/"]
    with SimulatedController(identity=given):
        pass


def test_what_the_launch_file_sets_is_what_the_driver_takes_and_has_its_defaults():
    _, params = nodes(["sim:=false"])
    given = {key.split("/")[-1]: value for key, value in params.items() if key.startswith("/jaka_driver/")}
    assert config_from(given) == config_from({}) and len(given) > 15


@pytest.mark.parametrize("name", ["robot_start_launch.launch", "display.launch"])
@pytest.mark.parametrize("given, expected", [([], ""), (["controller_profile:=none"], ""),
                                             (["controller_profile:=/a b/probe.json"], "/a b/probe.json")], ids=str)
def test_a_report_of_the_controller_reaches_the_driver_and_none_is_left_of_an_earlier_launch(name, given, expected):
    _, params = nodes(["ip:=10.5.5.100", *given], str(ROOT / "launch" / name))
    assert params["/jaka_driver/controller_profile"] == expected


def test_each_of_several_arms_has_its_own_report_or_none(tmp_path):
    arms = yaml.safe_load((ROOT / "docs" / "examples" / "arms.yaml").read_text())
    arms["left"]["jaka_driver"]["controller_profile"] = "/etc/jaka/left_probe.json"
    (tmp_path / "arms.yaml").write_text(yaml.safe_dump(arms))
    _, params = nodes(["file:=%s" % (tmp_path / "arms.yaml"), "arms:=left right"], str(ROOT / "launch" / "arms.launch"))
    assert params["/left/jaka_driver/controller_profile"] == "/etc/jaka/left_probe.json"
    assert params["/right/jaka_driver/controller_profile"] == ""


def test_a_launched_driver_knows_its_controller_by_the_report(ros_node, launch, free_ports, tmp_path):
    report = {"format": 1, "facts": {"io_index_base": {"value": 1, "how": "seen"}}}
    (tmp_path / "probe.json").write_text(json.dumps(report))
    command_port, status_port, panel_port = free_ports(3)
    launch("robot_start_launch.launch", "sim:=true", "command_port:=%d" % command_port,
           "status_port:=%d" % status_port, "sim_panel_port:=%d" % panel_port,
           "controller_profile:=%s" % (tmp_path / "probe.json"))
    with collecting("/diagnostics", DiagnosticArray) as seen:
        assert eventually(lambda: "1, seen on this controller" in [
            pair.value for _, message in seen for status in message.status for pair in status.values
            if pair.key == "first terminal"])


@pytest.mark.parametrize("arguments, topic, frame", [
    ([], "/jaka_driver/jog_twist", "base"), (["driver:=left/jaka_driver", "frame:=tool"], "/left/jaka_driver/jog_twist",
                                             "tool")], ids=["defaults", "another arm, tool"])
def test_a_gamepad_is_stamped_and_sent_to_the_driver(ros_node, arguments, topic, frame):
    # joy and teleop_twist_joy are not packaged by Debian: the file is read, and its stamping part is tried here.
    path = str(ROOT / "launch" / "gamepad.launch")
    config = roslaunch.config.load_config_default([(path, arguments)], None, verbose=False)
    params = {key: p.value for key, p in config.params.items()}
    assert {tuple(node.args.split()[:2]) for node in config.nodes} == {
        ("joy", "joy_node"), ("teleop_twist_joy", "teleop_node"), ("topic_tools", "transform")}
    assert {node.namespace for node in config.nodes} == {"/gamepad/"}
    assert params["/gamepad/joy/autorepeat_rate"] * FRESH_S >= 5, "several messages within the time that one counts"
    assert params["/gamepad/teleop/scale_linear/y"] <= DriverConfig().jog_max_linear_speed
    assert params["/gamepad/teleop/scale_angular/yaw"] <= DriverConfig().jog_max_angular_speed
    stamp = next(node for node in config.nodes if node.name == "stamp")
    assert list(map(list, stamp.remap_args)) == [["jog_twist", topic]]
    words = shlex.split(stamp.args)[2:]
    assert words[:4] == ["--wait-for-start", "cmd_vel", "jog_twist", "geometry_msgs/TwistStamped"]
    assert words[5:] == ["--import", "rospy", "std_msgs"]
    made = TwistStamped(*eval(words[4], {"rospy": rospy, "std_msgs": std_msgs}, {"m": Twist(linear=Vector3(y=0.1))}))
    assert made.header.frame_id == frame and made.twist.linear.y == 0.1
    assert abs((rospy.Time.now() - made.header.stamp).to_sec()) < 10.0


def test_the_demo_runs(ros_node, launch, free_ports):
    command_port, status_port, panel_port = free_ports(3)
    launch("demo.launch", "command_port:=%d" % command_port, "status_port:=%d" % status_port,
           "sim_panel_port:=%d" % panel_port, "sim_args:=--power-delay 0.1 --enable-delay 0.1")
    arm = Arm(None)
    arm.wait_until_seen()
    assert eventually(lambda: arm.listen("robot_states", 1)[0].power_state == 1)
    assert eventually(lambda: arm.call("joint_move", pose=[0.1, 1.5, -1.5, 1.5, 1.5, 0.0], mvvelo=3.0, mvacc=12.0).ret)


def test_the_demo_leaves_another_controller_on_its_ports_alone(ros_node, launch, tmp_path):
    log = tmp_path / "wire.mcap"
    with contextlib.closing(SimulatorProcess("--log", str(log))) as another:
        launch("demo.launch", "command_port:=%d" % another.command_port, "status_port:=%d" % another.status_port,
               "sim_panel_port:=0", "panel:=false")
        arm = Arm(None)
        assert eventually(lambda: "not the simulated one" in arm.call(
            "joint_move", pose=[0.1, 1.5, -1.5, 1.5, 1.5, 0.0], mvvelo=3.0, mvacc=12.0).message)
        assert not arm.call("power", data=True).success
        assert not another.state()["is_powered"]
    assert {request["cmdName"] for _, request in WireVerdict(log).received()} == {"get_simulator_identity"}


def test_display_has_one_tree_from_base_to_tool_that_equals_ours(ros_node, launch, free_ports):
    command_port, status_port = free_ports(2)
    rospy.delete_param("/robot_description") if rospy.has_param("/robot_description") else None
    launch("display.launch", "rviz:=false", "model:=pro16", "command_port:=%d" % command_port,
           "status_port:=%d" % status_port)
    arm = Arm(None)
    arm.wait_until_seen()
    with collecting("/tf", TFMessage) as moving, collecting("/tf_static", TFMessage) as fixed:
        def parents():
            """Return for each frame every (parent, transform) that somebody has published."""
            said = {}
            for _, message in fixed + moving[-100:]:
                for one in message.transforms:
                    said.setdefault(one.child_frame_id, {})[one.header.frame_id.lstrip("/")] = one.transform
            return said
        assert eventually(lambda: {"link_%d" % n for n in range(1, 7)} | {"tool0", "tool"} <= set(parents()))
        tree = parents()
    assert all(len(by_parent) == 1 for by_parent in tree.values()), "a frame with two parents is no tree"
    frame, base_t_flange = "tool0", IDENTITY
    while frame != "base_link":
        frame, transform = next(iter(tree[frame].items()))
        base_t_flange = compose(as_transform(transform), base_t_flange)
    joints = arm.listen("joint_position", 1)[0].position
    assert base_t_flange == pytest.approx(forward(load_model("pro16"), joints), abs=1e-5)


def as_transform(message):
    q, t = message.rotation, message.translation
    norm = math.sqrt(q.x * q.x + q.y * q.y + q.z * q.z)
    angle = 2.0 * math.atan2(norm, q.w) / (norm or 1.0)
    return matrix_from_rotation_vector((q.x * angle, q.y * angle, q.z * angle)) + (t.x, t.y, t.z)
