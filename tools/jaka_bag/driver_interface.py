"""The numbers in the topics of JAKA drivers that the plots and the comparison give names to."""
import enum


class MotionState(enum.IntEnum):
    """``motion_state`` of ``jaka_msgs/RobotMsg`` (docs/interface.md)."""

    STOPPED = 0
    PAUSED = 1
    EMERGENCY_STOP = 2
    RUNNING = 3
    ERROR = 4
