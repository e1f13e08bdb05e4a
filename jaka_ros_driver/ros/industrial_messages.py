"""industrial_msgs/RobotStatus, which is not packaged everywhere: the installed type, or one made at start."""
from typing import Any

import genpy.dynamic

TYPE = "industrial_msgs/RobotStatus"
MD5 = "b733cb45a38101840b75c4c0d6093d19"
"""Of the published definition: with another md5 no program of ROS-Industrial would connect."""
_SEPARATOR = "=" * 80 + "\n"
_DEFINITION = """\
Header header                   # stamp: arrival of the status frame that tells this; frame_id: empty
industrial_msgs/RobotMode mode
industrial_msgs/TriState e_stopped
industrial_msgs/TriState drives_powered
industrial_msgs/TriState motion_possible
industrial_msgs/TriState in_motion
industrial_msgs/TriState in_error
int32 error_code                # entry of the controller's event list, 0 for no error
""" + _SEPARATOR + """\
MSG: std_msgs/Header
uint32 seq
time stamp
string frame_id
""" + _SEPARATOR + """\
MSG: industrial_msgs/RobotMode
int8 val
int8 UNKNOWN=-1
int8 MANUAL=1
int8 AUTO=2
""" + _SEPARATOR + """\
MSG: industrial_msgs/TriState
int8 val
int8 UNKNOWN=-1
int8 TRUE=1
int8 ON=1
int8 ENABLED=1
int8 HIGH=1
int8 CLOSED=1
int8 FALSE=0
int8 OFF=0
int8 DISABLED=0
int8 LOW=0
int8 OPEN=0
"""


def robot_status_type() -> Any:
    """The message class: that of the package industrial_msgs where one is installed, else ``made_type``."""
    try:
        from industrial_msgs.msg import RobotStatus
    except ImportError:
        return made_type()
    return RobotStatus


def made_type() -> Any:
    """A class made from the definition of this file, the same on the wire."""
    return genpy.dynamic.generate_dynamic(TYPE, _DEFINITION)[TYPE]
