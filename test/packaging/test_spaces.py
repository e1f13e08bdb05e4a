"""The package as catkin's builders lay it out: the files that a user's shell finds in devel and install space."""
import hashlib
import re
import shutil
from pathlib import Path

import import_graph
import pytest

PROGRAMS = ("check_moveit_config", "jaka_bag", "jaka_doctor", "jaka_driver", "jaka_foxglove", "jaka_panel",
            "jaka_probe", "jaka_rostest", "jaka_sim", "migrate_cell")
TYPES = """
Move float32[] pose, bool has_ref, float32[] ref_joint, float32 mvvelo, float32 mvacc, float32 mvtime, float32 mvradii,
  int16 coord_mode, int16 index --- int16 ret, string message
ServoMoveEnable bool enable --- int16 ret, string message
ServoMove float32[] pose, float32[] speed --- int16 ret, string message
SetTcpFrame float32[] pose, int16 tool_num --- int16 ret, string message
SetUserFrame float32[] pose, int16 user_num --- int16 ret, string message
SetPayload int16 tool_num, float32 mass, float32 xc, float32 yc, float32 zc --- int16 ret, string message
SetCollision bool is_enable, int16 value --- int16 ret, string message
SetSpeedSlider float64 speed_slider_fraction --- bool success, string message
LoadProgram string name --- bool success, string message
SetWorkspace string yaml --- int16 ret, string message, string yaml
SetIO string signal, int16 type, int16 index, float32 value --- int16 ret, string message
GetIO string signal, int16 path, int16 type, int16 index --- float32 value, string message
ClearErr --- int16 ret, string message
ClearError bool enable --- int16 ret, string message
GetFK float32[] joint --- float32[] cartesian_pose, string message
GetIK float32[] ref_joint, float32[] cartesian_pose --- float32[] joint, string message
"""
SERVICES = {name: fields.split("---") for name, fields in
            re.findall(r"^(\w+) (.*)$", TYPES.replace("\n  ", " "), re.MULTILINE)}


def fields_of(text):
    return [field.strip() for field in text.split(",") if field.strip()]


def service_md5(name):
    """Return the md5 of a service of built-in types, as genmsg defines it: over its fields, one a line, request then
    reply."""
    return hashlib.md5("".join("\n".join(fields_of(part)) for part in SERVICES[name]).encode()).hexdigest()


@pytest.fixture(scope="module")
def plain_build(root, tmp_path_factory, shell, cmake_options):
    """Return a copy of the checkout, built in its folder build as tools/dev does it, and installed."""
    copy = tmp_path_factory.mktemp("plain") / "checkout"
    shutil.copytree(str(root), str(copy),
                    ignore=shutil.ignore_patterns(".*", "__pycache__", "build", "devel", "install"))
    shell("cmake -S . -B build -DCMAKE_INSTALL_PREFIX=%s/install %s && make -C build -j2 install"
          % (copy.parent, " ".join(cmake_options)), cwd=copy,
          ROS_LANG_DISABLE="gencpp:geneus:genlisp:gennodejs")  # test_workspaces.py has the C++ types
    return copy.parent


@pytest.fixture(scope="module", params=["checkout/build/devel", "install"])
def space(request, plain_build):
    return plain_build / request.param / "setup.bash"


def test_the_message_tools_find_the_types(space, shell):
    assert shell("rospack find jaka_msgs && rospack find jaka_ros_driver", space).stdout.count("\n") == 2
    request, reply = shell("rossrv show jaka_msgs/Move", space).stdout.strip().split("\n---\n")
    assert [request.split("\n"), reply.split("\n")] == [fields_of(part) for part in SERVICES["Move"]]
    assert shell("rosmsg show jaka_msgs/RobotMsg", space).stdout.split() == [
        "int16", "motion_state", "int16", "power_state", "int16", "servo_state", "int16", "collision_state"]
    assert "jaka_msgs/IOBank cabinet" in shell("rosmsg show jaka_msgs/IOStates", space).stdout
    assert "uint8[] request" in shell("rosmsg show jaka_msgs/ServiceCall", space).stdout


def test_python_finds_the_generated_types_with_the_right_md5(space, shell):
    program = 'import sys, jaka_msgs.srv as srv; print([getattr(srv, name)._md5sum for name in sys.argv[1:]])'
    printed = shell("/usr/bin/python3 -c '%s' %s" % (program, " ".join(SERVICES)), space).stdout
    assert printed.strip() == repr([service_md5(name) for name in SERVICES])


def test_every_definition_is_listed_and_every_field_has_a_comment(root):
    folder = root / "jaka_msgs"
    assert {path.stem for path in (folder / "srv").iterdir()} == set(SERVICES)
    listed = re.findall(r"^  (\w+\.(?:msg|srv))$", (folder / "CMakeLists.txt").read_text(), re.MULTILINE)
    definitions = sorted(path for kind in ("msg", "srv") for path in (folder / kind).iterdir())
    assert sorted(listed) == sorted(path.name for path in definitions)
    for path in definitions:
        for line in path.read_text().splitlines():
            assert line == "---" or "# " in line, "%s: no comment: %s" % (path.name, line)


@pytest.mark.parametrize("program", PROGRAMS)
def test_rosrun_and_roslaunch_find_one_program_each(space, shell, program):
    found = shell("catkin_find --libexec jaka_ros_driver %s" % program, space).stdout.split()
    assert len(found) == 1
    assert shell("rosrun --debug jaka_ros_driver %s --help" % program, space).returncode == 0


@pytest.mark.parametrize("program", PROGRAMS)
def test_a_spawned_worker_that_runs_the_program_again_does_nothing(space, shell, program):
    found = shell("catkin_find --libexec jaka_ros_driver %s" % program, space).stdout.strip()
    again = "import runpy, sys; sys.argv[0] = %r; runpy.run_path(%r, run_name=%r)" % (found, found, "__mp_main__")
    interpreter = Path(found).read_text().split("\n")[0][2:]  # multiprocessing.spawn does the same
    assert shell('%s -c "%s" --help' % (interpreter, again), space).stdout == ""


@pytest.mark.parametrize("words, told", [
    ("dataset add logs --to fleet --jobs 2", "fleet: 2 logs added"),
    ("compare %s/test/data/golden/boot.mcap --against logs --jobs 2 --results results" % import_graph.ROOT,
     "2 runs: 1 same, 1 different")])
def test_rosrun_gives_the_logs_to_several_workers(plain_build, shell, tmp_path, words, told):
    # in the devel space, and replays: test_every_command.py
    (tmp_path / "logs").mkdir()
    for name in ("boot.mcap", "io_sequence.mcap"):
        shutil.copy(str(import_graph.ROOT / "test" / "data" / "golden" / name), str(tmp_path / "logs"))
    done = shell("rosrun jaka_ros_driver jaka_bag " + words, plain_build / "install" / "setup.bash", cwd=tmp_path,
                 check=False)
    assert told in done.stdout and "Traceback" not in done.stdout, done.stdout


def test_the_black_box_finds_the_table_of_arms(space, shell):
    program = ("from jaka_blackbox.evidence import Evidence; evidence = Evidence('', '', '', dict); "
               "print([item.name for item in evidence.attachments()], evidence.facts()['missing'])")
    said = shell("/usr/bin/python3 -c \"%s\"" % program, space).stdout
    assert "arm_models.yaml" in said and "DH parameters" not in said


def test_the_simulation_runs_as_a_module_with_its_data(space, shell):
    shell("/usr/bin/python3 -m jaka_ros_driver.simulation --help", space)
    shell("/usr/bin/python3 -c 'from jaka_ros_driver.kinematics import arm_models as m; print(open(m.MODELS_FILE))'",
          space)


def test_the_log_tools_are_found_with_the_subcommands_that_need_the_driver(space, shell):
    shell("/usr/bin/python3 -c 'import jaka_bag, jaka_regression.command_lines; jaka_bag.__version__'", space)
    shell("rosrun jaka_ros_driver jaka_bag replay-commands --help", space)


def test_roslaunch_finds_a_launch_file_and_those_it_includes(space, shell):
    files = shell("roslaunch --files jaka_ros_driver demo.launch", space).stdout.split()
    assert [name.rsplit("/", 2)[1:] for name in sorted(files)] == [
        ["launch", "demo.launch"], ["launch", "panel.launch"], ["launch", "robot_start_launch.launch"]]


def test_a_plain_checkout_runs_the_simulation(root, shell):
    shell("/usr/bin/python3 -m jaka_ros_driver.simulation --help", cwd=root)


def test_catkin_lint_has_nothing_to_say(root, shell):
    ignored = " ".join("--ignore " + what for what in (
        "env_var",             # JAKA_MSGS_EXTERNAL
        "subproject",          # jaka_msgs
        "uninstalled_script",  # tools/dev
    ))
    shell("catkin_lint --quiet --strict --offline %s %s" % (ignored, root))
