"""A driver that was stopped for a while and goes on: nothing that it publishes is older than its stamp says."""
import signal
import time

import pytest
import rospy
from driver_bench import LiveDriver
from sensor_msgs.msg import JointState
from waiting import eventually

OLDEST = 0.25
"""Time that a frame may have been on its way on a busy host, s."""


@pytest.mark.parametrize("seconds", [0.4, 4.0])
def test_nothing_old_is_published_under_a_new_stamp(ros_node, tmp_path, seconds):
    with LiveDriver(tmp_path, name="thawed", guard=False, link_loss_stop=0.0) as live:
        live.arm.wait_until_ready()
        live.arm.go_home()
        samples = []
        subscriber = rospy.Subscriber("/thawed/joint_position", JointState, samples.append, queue_size=10000,
                                      tcp_nodelay=True)
        assert eventually(lambda: len(samples) > 50)
        assert live.arm.call("jog", mvvelo=0.5, coord_mode=0, index=0).ret == 1  # each position is passed once
        assert eventually(lambda: samples[-1].position[0] > 0.2)
        live.send(signal.SIGSTOP)
        time.sleep(seconds)  # so long it stands still
        count = len(samples)
        live.send(signal.SIGCONT)
        assert eventually(lambda: not live.simulator.is_moving())
        assert eventually(lambda: len(samples) > count + 100)
        subscriber.unregister()
        to_monotonic = time.monotonic() - rospy.get_time()
        truth = live.verdict().joints()
    times = [at for at, _ in truth]
    ages = []
    for sample in samples:
        stamp = sample.header.stamp.to_sec() + to_monotonic
        near = [abs(joints[0] - sample.position[0]) for at, joints in truth if stamp - OLDEST <= at <= stamp + 0.02]
        if near and times[0] < stamp < times[-1]:
            ages.append(min(near))
    assert len(ages) > 100
    assert max(ages) < 2e-3, "a position was published that the arm did not have at that time"
