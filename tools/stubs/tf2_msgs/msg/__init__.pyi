# Made by test/support/pages/message_stubs.py.
from typing import Sequence

import genpy
import geometry_msgs.msg

class TFMessage(genpy.Message):
    transforms: Sequence[geometry_msgs.msg.TransformStamped] = ...
