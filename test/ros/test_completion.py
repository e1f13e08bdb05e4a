"""Tab completion of rosservice call: what Debian's rosbash offers for a running service of jaka_msgs."""
import subprocess

import rospy

from jaka_msgs.srv import Move

COMPLETE = """
. /usr/share/bash-completion/completions/rosbash
COMP_WORDS=(%s) COMP_CWORD=%d
_roscomplete_rosservice
printf '%%s\\n' "${COMPREPLY[@]}"
"""


def completions(*words):
    script = COMPLETE % (" ".join("'%s'" % word for word in words), len(words) - 1)
    return subprocess.run(["bash", "-c", script], stdout=subprocess.PIPE, text=True, timeout=60, check=True).stdout


def test_the_name_and_then_the_request_are_completed(ros_node):
    service = rospy.Service("~joint_move", Move, lambda request: None)
    name = service.resolved_name
    assert name in completions("rosservice", "call", name[:-3])
    prototype = completions("rosservice", "call", name, "")
    assert "pose:" in prototype and "mvvelo: 0.0" in prototype and "index: 0" in prototype
    service.shutdown("the test is over")
