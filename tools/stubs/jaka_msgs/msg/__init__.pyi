# Made by test/support/pages/message_stubs.py.
from typing import ClassVar, Sequence

import actionlib_msgs.msg
import genpy
import std_msgs.msg

class IOBank(genpy.Message):
    digital_inputs: Sequence[bool]
    digital_outputs: Sequence[bool]
    analog_inputs: Sequence[float]
    analog_outputs: Sequence[float]
    def __init__(
        self,
        digital_inputs: Sequence[bool] = ...,
        digital_outputs: Sequence[bool] = ...,
        analog_inputs: Sequence[float] = ...,
        analog_outputs: Sequence[float] = ...,
    ) -> None: ...

class IOStates(genpy.Message):
    header: std_msgs.msg.Header
    cabinet: IOBank
    tool: IOBank
    extension: IOBank
    relays: Sequence[bool]
    modbus_slave: IOBank
    profinet_slave: IOBank
    ethernet_ip_slave: IOBank
    def __init__(
        self,
        header: std_msgs.msg.Header = ...,
        cabinet: IOBank = ...,
        tool: IOBank = ...,
        extension: IOBank = ...,
        relays: Sequence[bool] = ...,
        modbus_slave: IOBank = ...,
        profinet_slave: IOBank = ...,
        ethernet_ip_slave: IOBank = ...,
    ) -> None: ...

class MotionState(genpy.Message):
    ACCEPTED: ClassVar[int]
    COMPLETED: ClassVar[int]
    FOREIGN: ClassVar[int]
    FOREIGN_ENDED: ClassVar[int]
    STOPPED: ClassVar[int]
    header: std_msgs.msg.Header
    id: str
    state: int
    reason: str
    def __init__(
        self,
        header: std_msgs.msg.Header = ...,
        id: str = ...,
        state: int = ...,
        reason: str = ...,
    ) -> None: ...

class MovePathAction(genpy.Message):
    action_goal: MovePathActionGoal
    action_result: MovePathActionResult
    action_feedback: MovePathActionFeedback
    def __init__(
        self,
        action_goal: MovePathActionGoal = ...,
        action_result: MovePathActionResult = ...,
        action_feedback: MovePathActionFeedback = ...,
    ) -> None: ...

class MovePathActionFeedback(genpy.Message):
    header: std_msgs.msg.Header
    status: actionlib_msgs.msg.GoalStatus
    feedback: MovePathFeedback
    def __init__(
        self,
        header: std_msgs.msg.Header = ...,
        status: actionlib_msgs.msg.GoalStatus = ...,
        feedback: MovePathFeedback = ...,
    ) -> None: ...

class MovePathActionGoal(genpy.Message):
    header: std_msgs.msg.Header
    goal_id: actionlib_msgs.msg.GoalID
    goal: MovePathGoal
    def __init__(
        self,
        header: std_msgs.msg.Header = ...,
        goal_id: actionlib_msgs.msg.GoalID = ...,
        goal: MovePathGoal = ...,
    ) -> None: ...

class MovePathActionResult(genpy.Message):
    header: std_msgs.msg.Header
    status: actionlib_msgs.msg.GoalStatus
    result: MovePathResult
    def __init__(
        self,
        header: std_msgs.msg.Header = ...,
        status: actionlib_msgs.msg.GoalStatus = ...,
        result: MovePathResult = ...,
    ) -> None: ...

class MovePathFeedback(genpy.Message):
    segment: int
    fraction: float
    paused: bool
    def __init__(
        self,
        segment: int = ...,
        fraction: float = ...,
        paused: bool = ...,
    ) -> None: ...

class MovePathGoal(genpy.Message):
    segments: Sequence[PathSegment]
    def __init__(
        self,
        segments: Sequence[PathSegment] = ...,
    ) -> None: ...

class MovePathResult(genpy.Message):
    success: bool
    message: str
    completed: int
    fraction: float
    def __init__(
        self,
        success: bool = ...,
        message: str = ...,
        completed: int = ...,
        fraction: float = ...,
    ) -> None: ...

class PathSegment(genpy.Message):
    ARC: ClassVar[int]
    JOINT: ClassVar[int]
    LINE: ClassVar[int]
    type: int
    joints: Sequence[float]
    pose: Sequence[float]
    via: Sequence[float]
    speed: float
    acceleration: float
    blend_radius: float
    def __init__(
        self,
        type: int = ...,
        joints: Sequence[float] = ...,
        pose: Sequence[float] = ...,
        via: Sequence[float] = ...,
        speed: float = ...,
        acceleration: float = ...,
        blend_radius: float = ...,
    ) -> None: ...

class ProgramState(genpy.Message):
    IDLE: ClassVar[int]
    LOADING: ClassVar[int]
    PAUSED: ClassVar[int]
    RUNNING: ClassVar[int]
    UNKNOWN: ClassVar[int]
    header: std_msgs.msg.Header
    state: int
    program: str
    reason: str
    def __init__(
        self,
        header: std_msgs.msg.Header = ...,
        state: int = ...,
        program: str = ...,
        reason: str = ...,
    ) -> None: ...

class RecoverAction(genpy.Message):
    action_goal: RecoverActionGoal
    action_result: RecoverActionResult
    action_feedback: RecoverActionFeedback
    def __init__(
        self,
        action_goal: RecoverActionGoal = ...,
        action_result: RecoverActionResult = ...,
        action_feedback: RecoverActionFeedback = ...,
    ) -> None: ...

class RecoverActionFeedback(genpy.Message):
    header: std_msgs.msg.Header
    status: actionlib_msgs.msg.GoalStatus
    feedback: RecoverFeedback
    def __init__(
        self,
        header: std_msgs.msg.Header = ...,
        status: actionlib_msgs.msg.GoalStatus = ...,
        feedback: RecoverFeedback = ...,
    ) -> None: ...

class RecoverActionGoal(genpy.Message):
    header: std_msgs.msg.Header
    goal_id: actionlib_msgs.msg.GoalID
    goal: RecoverGoal
    def __init__(
        self,
        header: std_msgs.msg.Header = ...,
        goal_id: actionlib_msgs.msg.GoalID = ...,
        goal: RecoverGoal = ...,
    ) -> None: ...

class RecoverActionResult(genpy.Message):
    header: std_msgs.msg.Header
    status: actionlib_msgs.msg.GoalStatus
    result: RecoverResult
    def __init__(
        self,
        header: std_msgs.msg.Header = ...,
        status: actionlib_msgs.msg.GoalStatus = ...,
        result: RecoverResult = ...,
    ) -> None: ...

class RecoverFeedback(genpy.Message):
    step: str
    def __init__(
        self,
        step: str = ...,
    ) -> None: ...

class RecoverGoal(genpy.Message): ...

class RecoverResult(genpy.Message):
    success: bool
    message: str
    def __init__(
        self,
        success: bool = ...,
        message: str = ...,
    ) -> None: ...

class RobotMsg(genpy.Message):
    motion_state: int
    power_state: int
    servo_state: int
    collision_state: int
    def __init__(
        self,
        motion_state: int = ...,
        power_state: int = ...,
        servo_state: int = ...,
        collision_state: int = ...,
    ) -> None: ...

class ServiceCall(genpy.Message):
    header: std_msgs.msg.Header
    service: str
    service_type: str
    md5sum: str
    caller: str
    request: bytes
    response: bytes
    request_text: str
    response_text: str
    duration: float
    success: bool
    error: str
    def __init__(
        self,
        header: std_msgs.msg.Header = ...,
        service: str = ...,
        service_type: str = ...,
        md5sum: str = ...,
        caller: str = ...,
        request: bytes = ...,
        response: bytes = ...,
        request_text: str = ...,
        response_text: str = ...,
        duration: float = ...,
        success: bool = ...,
        error: str = ...,
    ) -> None: ...
