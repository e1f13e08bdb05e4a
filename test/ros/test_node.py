"""The executable: what it refuses to start with, a controller that comes later, energising, the URDF, its exit."""
import contextlib
import os
import subprocess
import sys
from types import SimpleNamespace

import pytest
import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from driver_bench import HOME, PROGRAM, Arm, DriverProcess, SimulatorProcess, collecting, on
from sensor_msgs.msg import JointState
from waiting import eventually

from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.ros.audit.recorder import Recorder
from jaka_ros_driver.ros.exit_codes import CONFIGURATION
from jaka_ros_driver.ros.services import table as services


@pytest.mark.parametrize("parameters, words", [
    ({"model": "zu77"}, ["~model", "'zu77'", "nearest is 'zu7'"]),
    ({"blocking": "perhaps"}, ["~blocking", "'perhaps'", "true or false"]),
    ({"comand_port": 1}, ["unknown parameter ~comand_port", "~command_port"])])
def test_it_does_not_start_with_a_wrong_parameter(ros_node, parameters, words):
    with DriverProcess("refusing", **parameters) as driver:
        code, said = driver.wait()
    assert code == CONFIGURATION and all(word in said for word in words) and "Traceback" not in said
    for name in parameters:
        rospy.delete_param("/refusing/" + name)


def test_started_before_the_controller_it_connects_when_that_comes(ros_node, free_ports):
    command_port, status_port = free_ports(2)
    with DriverProcess("early", ip="127.0.0.1", command_port=command_port, status_port=status_port):
        arm = Arm(None, "/early")
        answer = arm.call("joint_move", pose=HOME, mvvelo=1.0, mvacc=1.0)
        assert answer.ret == 0 and "no fresh status" in answer.message
        failed = arm.call("get_fk", joint=HOME)
        assert list(failed.cartesian_pose) == [] and "no link to the controller" in failed.message
        with contextlib.closing(SimulatorProcess("--start", "enabled", ports=(command_port, status_port))) as late:
            arm.simulator = late
            arm.wait_until_ready()
            arm.go_home()


def test_auto_enable_acts_once_and_never_again(ros_node):
    with contextlib.closing(SimulatorProcess()) as simulator, DriverProcess("enabling", **on(simulator, guard=False)):
        arm = Arm(simulator, "/enabling")
        arm.wait_until_ready()
        simulator.operate("press_emergency_stop")
        assert eventually(lambda: not simulator.state()["is_powered"])
        simulator.operate("release_emergency_stop")
        assert arm.call("clear_err").ret == 1
        simulator.operate("close")
        arm.wait_until_seen()
        assert not simulator.state()["is_powered"]
        assert arm.call("joint_move", pose=HOME, mvvelo=1.0, mvacc=1.0).ret == 0


@pytest.mark.parametrize("spoil", [None, "press_emergency_stop"], ids=["switched off", "arm not healthy"])
def test_nothing_is_energised_when_auto_enable_is_off_or_the_arm_is_not_healthy(ros_node, spoil):
    with contextlib.closing(SimulatorProcess()) as simulator:
        if spoil:
            simulator.operate(spoil)
        with DriverProcess("careful", auto_enable=spoil is not None, **on(simulator, guard=False)):
            arm = Arm(simulator, "/careful")
            arm.wait_until_seen()
            arm.listen("robot_states", 125)
            assert not simulator.state()["is_powered"]


def test_the_description_is_set_unless_somebody_else_has_set_one(ros_node):
    with contextlib.closing(SimulatorProcess()) as simulator:
        rospy.set_param("/robot_description", "<robot name='of a cell'/>")
        with DriverProcess("describing", **on(simulator, guard=False)):
            Arm(simulator, "/describing").wait_until_seen()
            assert rospy.get_param("/robot_description") == "<robot name='of a cell'/>"
        rospy.delete_param("/robot_description")
        with DriverProcess("describing", **on(simulator, guard=False)):
            Arm(simulator, "/describing").wait_until_seen()
            assert '<robot name="zu7">' in rospy.get_param("/robot_description")


def test_servo_targets_come_by_topic_as_well(ros_node):
    with contextlib.closing(SimulatorProcess("--start", "enabled")) as simulator, \
            DriverProcess("streamed", **on(simulator, guard=False)):
        arm = Arm(simulator, "/streamed")
        arm.wait_until_ready()
        arm.go_home()
        assert arm.call("servo_move_enable", enable=True).ret == 1
        publisher = rospy.Publisher("/streamed/servo_j_command", JointState, queue_size=1, tcp_nodelay=True)
        assert eventually(lambda: publisher.get_num_connections() > 0)
        publisher.publish(JointState(position=[0.02] + HOME[1:]))
        assert eventually(lambda: simulator.state()["joint_position"][0] > 1.1)
        publisher.unregister()


def test_the_urdf_is_printed():
    done = subprocess.run([*PROGRAM, "--urdf", "pro16", "--frame-prefix", "a_"], stdout=subprocess.PIPE, text=True)
    assert done.returncode == 0 and '<link name="a_tool0">' in done.stdout
    wrong = subprocess.run([*PROGRAM, "--urdf", "pro17"], stderr=subprocess.PIPE, text=True)
    assert wrong.returncode == CONFIGURATION
    assert wrong.stderr.startswith("jaka_driver: error: parameter ~model is 'pro17'")


def test_a_wrong_model_is_told_in_diagnostics_and_in_the_log(ros_node):
    with contextlib.closing(SimulatorProcess("--start", "enabled")) as simulator, \
            DriverProcess("mistaken", model="zu12", **on(simulator, guard=False)) as driver, \
            collecting("/diagnostics", DiagnosticArray) as reports:
        def verdict():
            return [status for _, array in reports for status in array.status
                    if status.name == "mistaken: kinematic model" and status.level == DiagnosticStatus.ERROR]
        assert eventually(verdict)
        assert "differs from model zu12" in verdict()[0].message
        _, said = driver.end()
    assert said.count("is ~model right?") == 1


def test_the_driver_runs_with_real_time_priority_where_that_is_permitted(ros_node):
    allowed = subprocess.run([sys.executable, "-c", "import os; os.sched_setscheduler(0, os.SCHED_FIFO, "
                              "os.sched_param(3))"], stderr=subprocess.DEVNULL).returncode == 0
    with contextlib.closing(SimulatorProcess()) as simulator, \
            DriverProcess("urgent", realtime_priority=3, **on(simulator, guard=False)) as driver:
        Arm(simulator, "/urgent").wait_until_seen()
        threads = scheduling_of(driver.process.pid)
        _, said = driver.end()
    assert {policy for policy, _ in threads} == {os.SCHED_FIFO if allowed else os.SCHED_OTHER}
    assert ("not permitted" in said) != allowed


def test_every_thread_of_the_driver_has_short_slices(ros_node):
    ask = "import jaka_ros_driver.scheduling as s; s.ask_for_short_slices(); print(open('/proc/self/sched').read())"
    granted = subprocess.run([sys.executable, "-c", ask], stdout=subprocess.PIPE, check=True, text=True).stdout
    with contextlib.closing(SimulatorProcess()) as simulator, \
            DriverProcess("brief", **on(simulator, guard=False)) as driver:
        Arm(simulator, "/brief").wait_until_seen()
        threads = scheduling_of(driver.process.pid)
        driver.end()
    assert threads == {(os.SCHED_OTHER, slice_in(granted))}


def scheduling_of(pid):
    """Return (policy, slice) of each thread."""
    found = set()
    for task in os.listdir("/proc/%d/task" % pid):
        with contextlib.suppress(ProcessLookupError, FileNotFoundError), \
                open("/proc/%d/task/%s/sched" % (pid, task)) as account:
            found.add((os.sched_getscheduler(int(task)), slice_in(account.read())))
    return found


def slice_in(account):
    """Return the slice in ns; None where the kernel does not show it."""
    return next((int(line.split()[-1]) for line in account.splitlines() if line.startswith("se.slice")), None)


def test_a_defect_in_a_service_is_a_service_error_with_evidence_and_the_next_call_is_served(ros_node, monkeypatch):
    def defective(operations, command):
        raise KeyError("a defect")
    monkeypatch.setattr(services, "SERVICES", (
        services.ServiceSpec("defective", services.types.ClearErr, services.RequestDecoder.nothing, defective),))
    publisher = SimpleNamespace(
        failures=[], failed=lambda call, error: publisher.failures.append((call.service, error)))
    services.Services(services.RequestDecoder(load_model("zu7")), None, publisher, Recorder(None)).offer()
    proxy = rospy.ServiceProxy("~defective", services.types.ClearErr)
    for _ in range(2):
        with pytest.raises(rospy.ServiceException, match="a defect"):
            proxy()
    assert publisher.failures == [(rospy.get_name() + "/defective", "internal error: KeyError('a defect')")] * 2
