# Made by test/support/pages/message_stubs.py.
from typing import Sequence

import genpy
import std_msgs.msg

class JointTrajectory(genpy.Message):
    header: std_msgs.msg.Header
    joint_names: Sequence[str]
    points: Sequence[JointTrajectoryPoint]
    def __init__(
        self,
        header: std_msgs.msg.Header = ...,
        joint_names: Sequence[str] = ...,
        points: Sequence[JointTrajectoryPoint] = ...,
    ) -> None: ...

class JointTrajectoryPoint(genpy.Message):
    positions: Sequence[float]
    velocities: Sequence[float]
    accelerations: Sequence[float]
    effort: Sequence[float]
    time_from_start: genpy.Duration
    def __init__(
        self,
        positions: Sequence[float] = ...,
        velocities: Sequence[float] = ...,
        accelerations: Sequence[float] = ...,
        effort: Sequence[float] = ...,
        time_from_start: genpy.Duration = ...,
    ) -> None: ...
