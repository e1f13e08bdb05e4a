"""The page docs/upgrade.md: a section for each released version, and what its users have written starts unchanged."""
import contextlib
import re
import shutil
import subprocess

import pytest
import roslaunch.arg_dump
import rosservice
import rostopic
import yaml
from driver_bench import Arm, DriverProcess, SimulatorProcess
from import_graph import ROOT
from page_commands import Shell
from waiting import eventually

from jaka_ros_driver.kinematics.arm_models import model_names
from jaka_ros_driver.ros.params import DriverConfig, config_from

PAGE = (ROOT / "docs" / "upgrade.md").read_text(encoding="utf-8")
RECORDED = ROOT / "test" / "data" / "upgrade"
RELEASED = re.findall(r"^(\d+\.\d+\.\d+) \(\d{4}-\d\d-\d\d\)$", (ROOT / "CHANGELOG.rst").read_text(encoding="utf-8"),
                      re.MULTILINE)
COMMITS = dict(re.findall(r"^\| (\d+\.\d+\.\d+) \| `([0-9a-f]{8,40})` \|$", PAGE, re.MULTILINE))
"""The commits in the page's table, by version."""
OLD_LAUNCH = "as_released.launch"
"""The name of robot_start_launch.launch there: roslaunch would find two files of that one in the package."""


def recorded(version, name):
    return yaml.safe_load((RECORDED / version / name).read_text(encoding="utf-8"))


def test_each_released_version_has_its_section_and_its_configuration():
    assert RELEASED and [version for version in RELEASED if "\n## From %s\n" % version not in PAGE] == []
    assert {path.name for path in RECORDED.iterdir()} == set(RELEASED)


def version_at(commit):
    """Return the version in the package.xml of a commit; skip where this is no clone with its history."""
    if shutil.which("git") is None or not (ROOT / ".git").exists():
        pytest.skip("no git, or no clone: nobody can look into a commit")

    def git(*words):
        return subprocess.run(["git", "-C", str(ROOT), *words], stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                              text=True)

    if git("rev-parse", "--is-shallow-repository").stdout.strip() != "false":
        pytest.skip("a shallow clone, or one that git does not read: its history is not here")
    shown = git("show", "%s:package.xml" % commit)
    assert shown.returncode == 0, shown.stdout
    return re.search(r"<version>(.+)</version>", shown.stdout).group(1)


def test_each_released_version_has_its_commit():
    assert set(COMMITS) == set(RELEASED)


@pytest.mark.parametrize("version", COMMITS)
def test_a_commit_is_the_first_with_its_version(version):
    assert version_at(COMMITS[version]) == version != version_at(COMMITS[version] + "^")


@pytest.mark.parametrize("version", RELEASED)
def test_parameters_of_then_are_taken_and_mean_the_same(version):
    values = recorded(version, "parameters.yaml")
    config, now = config_from(values), DriverConfig()
    assert len(values) >= 33
    assert {name for name in values if getattr(config, name) != getattr(now, name)} == set(), "a default has changed"
    for model in recorded(version, "names.yaml")["models"]:
        assert model in model_names() and config_from({"model": model}).arm_model().name


@pytest.mark.parametrize("version", RELEASED)
def test_launch_arguments_of_then_are_still_there(version):
    old = roslaunch.arg_dump.get_args([str(RECORDED / version / OLD_LAUNCH)])
    new = roslaunch.arg_dump.get_args([str(ROOT / "launch" / "robot_start_launch.launch")])
    assert set(old) <= set(new) and len(old) >= 14
    same = {name for name in old if name != "identity" and old[name][1] == new[name][1]}
    assert set(old) - same <= {"dh_file", "frame_prefix", "identity", "sim_args"}, "an empty default is none now"


@pytest.mark.parametrize("version", RELEASED)
def test_a_launch_file_of_then_starts_and_has_every_name_of_then(ros_node, shell: Shell, version):
    with contextlib.closing(SimulatorProcess()) as simulator:
        shell.start("driver", "roslaunch %s ip:=localhost sim:=false command_port:=%d status_port:=%d" % (
            RECORDED / version / OLD_LAUNCH, simulator.command_port, simulator.status_port))
        arm = Arm(simulator)
        arm.wait_until_ready()
        has_every_name_of(version, "/jaka_driver")
        shell.end("driver")
    assert "Traceback" not in shell.said_by("driver") and "FATAL" not in shell.said_by("driver")


@pytest.mark.parametrize("version", RELEASED)
def test_a_driver_with_every_parameter_of_then_starts_and_moves_the_arm(ros_node, version):
    values = recorded(version, "parameters.yaml")
    with contextlib.closing(SimulatorProcess()) as simulator:
        values.update(command_port=simulator.command_port, status_port=simulator.status_port)
        with DriverProcess("upgraded", **values):
            arm = Arm(simulator, "/upgraded")
            arm.wait_until_ready()
            arm.go_home()
            has_every_name_of(version, "/upgraded")


def has_every_name_of(version, node):
    names = recorded(version, "names.yaml")
    assert len(names["services"]) >= 20
    for name, kind in names["services"].items():
        assert rosservice.get_service_type("%s/%s" % (node, name)) == kind, name
    for name, kind in names["topics"].items():
        assert eventually(lambda name=name: rostopic.get_topic_type("%s/%s" % (node, name))[0]) == kind, name


@pytest.mark.parametrize("option, version", [("-u 1", "0.2.0"), ("-d 1", "0.2.0")])
def test_an_option_that_is_gone_is_refused_and_named_on_the_page(shell: Shell, option, version):
    code, said = shell.run("rosrun jaka_ros_driver jaka_bag filter in.bag -o out.bag %s" % option)
    assert code == 2, said
    assert "`%s TIME`" % option.split()[0] in PAGE.split("\n## From %s\n" % version)[1]


