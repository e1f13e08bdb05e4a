"""A real roscore, killed and started again on the same port: the driver is found again, and old connections stay."""
import contextlib
import http.client
import subprocess
import threading
from xml.parsers.expat import ExpatError

import pytest
import rosgraph
import rospy
from driver_bench import HOME, DriverProcess, SimulatorProcess, on
from ros_graph import Roscore, tell_name
from waiting import WAIT, eventually

from jaka_ros_driver.ros import master_watch
from jaka_ros_driver.ros.services.table import SERVICES

FIELDS = "{joint: %s}" % HOME


@pytest.fixture
def roscore(ros_master, free_ports, tmp_path):
    core = Roscore(free_ports(1)[0], tmp_path)
    yield core
    core.kill()


def test_the_driver_registers_with_the_new_master(roscore):
    roscore.start()
    roscore.ask("deleteParam", "/run_id")  # not every master is roscore's, and has one
    with contextlib.closing(SimulatorProcess("--start", "enabled")) as simulator, \
            DriverProcess("jaka_driver", roscore.environment, **on(simulator, guard=False)):
        expected = {"/jaka_driver/" + spec.name for spec in SERVICES}
        assert eventually(lambda: expected <= roscore.registered()[2])
        before, address = roscore.registered(), roscore.ask("lookupNode", "/jaka_driver")
        listener = subprocess.Popen(["rostopic", "echo", "-p", "/jaka_driver/joint_position"], env=roscore.environment,
                                    stdout=subprocess.PIPE, text=True)
        try:
            assert listener.stdout.readline().startswith("%time") and listener.stdout.readline()
            roscore.kill()
            assert listener.stdout.readline(), "an old connection ended with the master"
            roscore.start()
            tell_name(roscore.uri, "/jaka_driver", address)
            assert eventually(lambda: all(old <= new for old, new in zip(before, roscore.registered())))
            assert listener.stdout.readline(), "an old connection ended with the new master"
        finally:
            listener.terminate()
            listener.communicate(timeout=WAIT)
        assert eventually(lambda: '<robot name="zu7">' in (roscore.ask("getParam", "/robot_description") or ""))
        assert "cartesian_pose: [4" in roscore.run("rosservice", "call", "/jaka_driver/get_fk", FIELDS)
        assert "joint_1" in roscore.run("rostopic", "echo", "-n1", "/jaka_driver/joint_position")


# ---- with a master that the test plays ----

class Master:
    """A ROS master; ``services`` are those that are registered."""

    def __init__(self):
        self.services = {rospy.get_name() + "/get_loggers"}
        self.asked = threading.Semaphore(0)
        self.defect = None
        self.offers, self.refusal = 0, None

    def lookupService(self, name):
        self.asked.release()
        if self.defect is not None:
            raise self.defect
        if name not in self.services:
            raise rosgraph.MasterError("unknown service")
        return "rosrpc://127.0.0.1:1"


    def offer(self):
        self.offers += 1
        if self.refusal is not None:
            raise self.refusal


@pytest.fixture
def watched(monkeypatch):
    """Return the master, and how often this node has registered and set its parameters since."""
    master, registered, told = Master(), [], []
    monkeypatch.setattr(master_watch.rosgraph, "Master", lambda name: master)
    monkeypatch.setattr(master_watch, "register_all", lambda: registered.append(True))
    watch = master_watch.MasterWatch(lambda: told.append(True), (master.offer,), 0.01)
    watch.start()
    yield master, registered, told
    watch.close()
    watch._thread.join(20.0)


def looked(master, times=3):
    for _ in range(times):
        assert master.asked.acquire(timeout=20.0)


@pytest.mark.parametrize("defect", [ExpatError("no element found"), http.client.BadStatusLine("x"), TypeError("int"),
                                    ConnectionResetError()])
def test_an_answer_that_is_cut_off_or_of_another_program_does_not_end_the_watch(watched, defect):
    master, registered, told = watched
    master.defect = defect
    looked(master)
    assert not registered
    master.services, master.defect = set(), None
    assert eventually(lambda: told)


def test_a_master_that_is_gone_is_told_once_and_that_it_is_back(watched, caplog):
    caplog.set_level("INFO", master_watch.__name__)

    def told():
        return [record.getMessage() for record in caplog.records if record.name == master_watch.__name__]

    master, registered, _ = watched
    for error in ("refused", "refused again"):
        caplog.clear()
        master.defect = ConnectionRefusedError(error)
        assert eventually(told)
        while master.asked.acquire(blocking=False):
            pass
        looked(master, 5)
        assert len(told()) == 1 and "does not answer" in told()[0] and "~stop_move" in told()[0] and error in told()[0]
        master.defect = None
        assert eventually(lambda: len(told()) == 2) and "answers again" in told()[1]
        assert len(told()) == 2 and not registered


def test_offers_are_made_while_the_master_answers_and_one_that_fails_ends_no_watch(watched, caplog):
    master, registered, told = watched
    assert eventually(lambda: master.offers >= 3)
    master.defect = ConnectionRefusedError("gone")
    looked(master, 2)
    count = master.offers
    looked(master)
    assert master.offers == count, "an offer would wait for the master"
    master.defect, master.refusal = None, OSError("gone just now")
    assert eventually(lambda: master.offers >= count + 3)
    assert "cannot be offered" in caplog.text and "gone just now" in caplog.text
    master.services = set()
    assert eventually(lambda: told), "the watch has ended"


def test_a_master_that_knows_the_node_is_left_alone_and_a_new_one_gets_everything(watched):
    master, registered, told = watched
    looked(master)
    assert not registered and not told
    services, master.services = master.services, set()
    assert eventually(lambda: told)
    master.services = services
    looked(master)
    count = len(registered)
    looked(master)
    assert len(registered) == len(told) == count
