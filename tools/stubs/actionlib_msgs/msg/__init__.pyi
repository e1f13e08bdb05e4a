# Made by test/support/pages/message_stubs.py.
from typing import ClassVar

import genpy

class GoalID(genpy.Message):
    stamp: genpy.Time = ...
    id: str = ...

class GoalStatus(genpy.Message):
    ABORTED: ClassVar[int]
    ACTIVE: ClassVar[int]
    LOST: ClassVar[int]
    PENDING: ClassVar[int]
    PREEMPTED: ClassVar[int]
    PREEMPTING: ClassVar[int]
    RECALLED: ClassVar[int]
    RECALLING: ClassVar[int]
    REJECTED: ClassVar[int]
    SUCCEEDED: ClassVar[int]
    goal_id: GoalID = ...
    status: int = ...
    text: str = ...
