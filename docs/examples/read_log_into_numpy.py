#!/usr/bin/env python3
"""A reader of a state log: it loads the joints into numpy and prints what they did. No ROS is needed.

usage: read_log_into_numpy.py LOG    (.bag or .mcap, for instance of ``jaka_bag record --state-log``)
"""
import sys

import numpy as np

import jaka_bag

TOPIC = "/jaka_driver/joint_position"


def main() -> int:
    """Read the log, print one line a joint."""
    if len(sys.argv) != 2:
        print(__doc__.strip(), file=sys.stderr)
        return 2
    # All messages of a topic at once: one array a field, its first axis is the message.
    columns = jaka_bag.read_columns(sys.argv[1], [TOPIC])[TOPIC]
    position = columns.fields["position"]  # rad, shape (n, 6)
    stamp = columns.fields["header.stamp"]  # ns, int64, shape (n,): when the controller's status frame arrived

    fresh = np.append(True, np.diff(stamp) > 0)  # a sample that is repeated to keep the rate keeps its stamp
    seconds = (stamp[fresh] - stamp[0]) / 1e9
    speed = np.diff(position[fresh], axis=0) / np.diff(seconds)[:, np.newaxis]
    print("%d samples in %.3f s" % (len(position), seconds[-1]))
    for joint in range(position.shape[1]):
        print("joint %d: %+.4f to %+.4f rad, at most %.3f rad/s" % (
            joint + 1, position[:, joint].min(), position[:, joint].max(), np.abs(speed[:, joint]).max()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
