"""Custody of a moving arm on real sockets: many callers at once, a stop beside the handshake, a silent network."""
import contextlib
import threading
import time

from waiting import StallWatch, eventually

from jaka_ros_driver import commands as c
from jaka_ros_driver.errors import JakaError, StopNotSeen
from jaka_ros_driver.simulation.arm.plant import HOME

JOG = c.Jog(c.JogFrame.JOINT, 0, 0.3)


def assert_in_custody_while_it_moves(one, arm, seconds):
    """Assert for so long that the arm never moves without an owner for more than 0.3 s, with at least ten sightings."""
    seen = []
    end = time.monotonic() + seconds
    with StallWatch() as host:
        while time.monotonic() < end:
            seen = [*seen, time.monotonic()] if one.is_moving() and arm.motion_owner is None else []
            assert len(seen) < 10 or host.between(seen[0], seen[-1]) < 0.3, "the arm moves and nobody owns its motion"
            time.sleep(0.01)  # between two looks


def test_a_stop_is_delivered_while_the_handshake_goes_on(bench):
    one = bench()
    arm = one.connect()
    asked = one.requests("get_simulator_identity")
    one.operate("fault", kind="delay", port="command", count=None, delay_ms=600)
    one.operate("close", port="command")
    assert eventually(lambda: one.requests("get_simulator_identity") > asked)
    with StallWatch() as host:
        began = time.monotonic()
        with contextlib.suppress(StopNotSeen):  # the controller's answer that it rests may take too long
            arm.stop()
        stop, = one.times_of("stop_program")
        assert host.between(began, stop) < 1.5, "the five questions of the handshake take 3 s"


def test_the_controller_itself_stops_the_arm_when_the_network_falls_silent(bench):
    one = bench()
    arm = one.connect(link_loss_stop=0.3)
    arm.jog(JOG)
    assert eventually(one.is_moving)
    with StallWatch() as host:
        one.operate("stall", duration_ms=4000)
        struck = time.monotonic()
        assert eventually(lambda: not one.is_moving())
        assert host.between(struck) < 3.0, "the driver itself can do nothing for 4 s"
    assert eventually(lambda: arm.is_ready and arm.motion_owner is None)
    assert not one.is_moving()


def test_thirty_callers_at_once_leave_the_arm_owned_or_at_rest(bench):
    one = bench()
    arm = one.connect(jog_timeout=0.3)
    over = threading.Event()

    def caller(number):
        turn = 0
        while not over.is_set():
            turn += 1
            try:
                if number % 3 == 0:
                    arm.jog(c.Jog(c.JogFrame.JOINT, number % 6, 0.1))
                elif number % 3 == 1:
                    arm.move(c.JointMove((0.01 * (turn % 7),) + HOME[1:], 0.5, 4.0), wait=turn % 2 == 0)
                else:
                    arm.stop()
            except JakaError:
                pass
            time.sleep(0.02 * (number % 5))  # each caller has its own rhythm
    threads = [threading.Thread(target=caller, args=(number,)) for number in range(30)]
    for thread in threads:
        thread.start()
    try:
        assert_in_custody_while_it_moves(one, arm, 4.0)
    finally:
        over.set()
        for thread in threads:
            thread.join()
    assert eventually(lambda: arm.motion_owner is None)
    assert not one.is_moving()
