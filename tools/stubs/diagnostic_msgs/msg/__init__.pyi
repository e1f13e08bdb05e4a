# Made by test/support/pages/message_stubs.py.
from typing import ClassVar, Sequence

import genpy
import std_msgs.msg

class DiagnosticArray(genpy.Message):
    header: std_msgs.msg.Header
    status: Sequence[DiagnosticStatus]
    def __init__(
        self,
        header: std_msgs.msg.Header = ...,
        status: Sequence[DiagnosticStatus] = ...,
    ) -> None: ...

class DiagnosticStatus(genpy.Message):
    ERROR: ClassVar[int]
    OK: ClassVar[int]
    STALE: ClassVar[int]
    WARN: ClassVar[int]
    level: int
    name: str
    message: str
    hardware_id: str
    values: Sequence[KeyValue]
    def __init__(
        self,
        level: int = ...,
        name: str = ...,
        message: str = ...,
        hardware_id: str = ...,
        values: Sequence[KeyValue] = ...,
    ) -> None: ...

class KeyValue(genpy.Message):
    key: str
    value: str
    def __init__(
        self,
        key: str = ...,
        value: str = ...,
    ) -> None: ...
