"""A roscore for an executable that is no test, and the formatting of figures."""
import contextlib
import os
import sys
import tempfile
from pathlib import Path

import rospy
from host_load import HostLoad
from launching import launched_parent

sys.path.append(str(Path(__file__).resolve().parents[1] / "ros"))


@contextlib.contextmanager
def master():
    """Make this process a ROS node of a roscore of its own, for a while."""
    import conftest
    with tempfile.TemporaryDirectory() as home:
        port = conftest.free_port()
        os.environ.update(ROS_MASTER_URI="http://127.0.0.1:%d" % port, ROS_IP="127.0.0.1", ROS_HOME=home,
                          ROS_LOG_DIR=home, TMPDIR=home)
        os.environ.pop("ROS_NAMESPACE", None)
        with launched_parent(is_core=True, port=port):
            host = HostLoad()
            print("at start: load average %.2f" % os.getloadavg()[0], flush=True)
            rospy.init_node("soak", anonymous=True, disable_signals=True)
            try:
                yield
                print("in all: %s" % host, flush=True)
            finally:
                rospy.signal_shutdown("done")


def percentile(values, share):
    """Return the value below which that share of them lies."""
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))]


def summary(seconds):
    """Format median, 95th percentile and largest of durations in s, in ms."""
    return "n %3d  p50 %7.1f ms  p95 %7.1f ms  max %7.1f ms" % (
        len(seconds), 1e3 * percentile(seconds, 0.5), 1e3 * percentile(seconds, 0.95), 1e3 * max(seconds))
