"""The stamps of recorded messages that are sent again: moved to now, in the order that they had."""
import pytest
import rospy
from sensor_msgs.msg import JointState

from jaka_regression.message_player import MessagePlayer


@pytest.mark.parametrize(("stamps", "recorded", "sent", "told"), [
    ((10.0, 10.016), (10.001, 10.017), (50.001, 50.017), (50.0, 50.016)),
    # both come late, at once: the second was recorded 2 ms later after its stamp than the first
    ((10.0, 10.016), (10.001, 10.019), (50.1, 50.1), (50.099, 50.099)),
    ((10.016, 10.0), (10.017, 10.018), (50.017, 50.018), (50.016, 50.0)),  # as the log has them
    ((0.0, 10.0), (10.001, 10.001), (50.001, 50.001), (0.0, 50.0))], ids=["in time", "late", "disordered", "none"])
def test_stamps_keep_their_order(stamps, recorded, sent, told):
    player = MessagePlayer(lambda: None)
    found = []
    for stamp, recorded_at, now in zip(stamps, recorded, sent):
        message = JointState()
        message.header.stamp = rospy.Time.from_sec(stamp)
        player.move_stamps("/servo", message, rospy.Duration.from_sec(now - recorded_at))
        found.append(message.header.stamp.to_sec())
    assert found == pytest.approx(told, abs=1e-6)
