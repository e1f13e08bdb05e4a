# Made by test/support/pages/message_stubs.py.
from typing import ClassVar, Sequence

import genpy
import std_msgs.msg

class Log(genpy.Message):
    DEBUG: ClassVar[int]
    ERROR: ClassVar[int]
    FATAL: ClassVar[int]
    INFO: ClassVar[int]
    WARN: ClassVar[int]
    header: std_msgs.msg.Header
    level: int
    name: str
    msg: str
    file: str
    function: str
    line: int
    topics: Sequence[str]
    def __init__(
        self,
        header: std_msgs.msg.Header = ...,
        level: int = ...,
        name: str = ...,
        msg: str = ...,
        file: str = ...,
        function: str = ...,
        line: int = ...,
        topics: Sequence[str] = ...,
    ) -> None: ...
