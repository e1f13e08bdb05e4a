"""Controllers at IPv6 addresses and under names: driven, guarded, locked; and addresses that are none."""
import contextlib
import os
import signal
import socket
import subprocess

import pytest
import rospy
from driver_bench import PROGRAM, Arm, DriverProcess, SimulatorProcess, on
from waiting import WAIT, eventually

from jaka_ros_driver.ros.exit_codes import CONFIGURATION, RIVAL


def has_ipv6():
    with contextlib.suppress(OSError), socket.socket(socket.AF_INET6, socket.SOCK_STREAM) as probe:
        probe.bind(("::1", 0))
        return True
    return False


needs_ipv6 = pytest.mark.skipif(not has_ipv6(), reason="this computer has no IPv6")


@pytest.fixture(scope="module")
def simulator(ros_node):
    with contextlib.closing(SimulatorProcess("--host", "::1", "--start", "enabled")) as simulator:
        yield simulator


def at(simulator, ip, guard=False):
    return dict(on(simulator, guard), ip=ip)


@needs_ipv6
def test_an_arm_at_an_ipv6_address_moves_and_the_guard_stops_it_when_the_driver_dies(simulator):
    with DriverProcess("six", **at(simulator, "::1", guard=True)) as driver:
        arm = Arm(simulator, "/six")
        arm.wait_until_ready()
        arm.go_home()
        assert eventually(lambda: arm.call("jog", mvvelo=0.2, coord_mode=0, index=0).ret == 1)
        assert eventually(simulator.is_moving)
        driver.process.send_signal(signal.SIGKILL)
        _, said = driver.wait()
    assert "SIMULATED ARM: the controller at [::1]:%d" % simulator.command_port in said
    assert eventually(lambda: not simulator.is_moving())


@needs_ipv6
@pytest.mark.parametrize("other", ["0:0:0::1", "::ffff:127.0.0.1"])
def test_one_controller_under_two_spellings_has_one_driver(simulator, other):
    with DriverProcess("older", **at(simulator, "::1")) as older:
        assert any("driving a JAKA" in line for line in iter(older.process.stdout.readline, ""))
        with DriverProcess("newer", **at(simulator, other)) as newer:
            code, said = newer.wait()
    assert code == RIVAL and "already driven by node /older" in said


@needs_ipv6
def test_a_controller_that_is_not_there_is_named_with_brackets(ros_node, free_ports):
    command_port, status_port = free_ports(2)
    with DriverProcess("six", ip="::1", command_port=command_port, status_port=status_port, guard=False) as driver:
        words = "cannot connect to [::1]:"
        assert any(words in line for line in iter(driver.process.stdout.readline, ""))


def test_a_name_is_driven(ros_node):
    with contextlib.closing(SimulatorProcess("--start", "enabled")) as simulator, \
            DriverProcess("named", **at(simulator, "localhost")):
        Arm(simulator, "/named").wait_until_ready()


@pytest.mark.parametrize("word", [b"_ip:=\xef\xbc\x91\xef\xbc\x90.5.5.100", b"_ip:=m\xc3\xbcnchen", b"_ip:=m\xfcnchen",
                                  b"_model:=\xff", b"joint_states:=\xff"])
@pytest.mark.parametrize("locale", ["C.UTF-8", "POSIX"])
def test_a_word_that_is_not_ascii_is_refused_in_one_line(ros_node, word, locale):
    done = subprocess.run([*PROGRAM, "__name:=refused", word], env=dict(os.environ, LC_ALL=locale, PYTHONUTF8="0"),
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=WAIT)
    assert done.returncode == CONFIGURATION and b"cannot start: " in done.stdout, done.stdout
    assert b"Traceback" not in done.stdout, done.stdout
    with contextlib.suppress(KeyError):
        rospy.delete_param("/refused")
