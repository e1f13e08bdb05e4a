# Made by test/support/pages/message_stubs.py.
from typing import Sequence

import genpy
import std_msgs.msg

class JointState(genpy.Message):
    header: std_msgs.msg.Header
    name: Sequence[str]
    position: Sequence[float]
    velocity: Sequence[float]
    effort: Sequence[float]
    def __init__(
        self,
        header: std_msgs.msg.Header = ...,
        name: Sequence[str] = ...,
        position: Sequence[float] = ...,
        velocity: Sequence[float] = ...,
        effort: Sequence[float] = ...,
    ) -> None: ...
