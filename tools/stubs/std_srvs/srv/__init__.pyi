# Made by test/support/pages/message_stubs.py.
from typing import ClassVar

import genpy

class Empty:
    _type: ClassVar[str]
    _md5sum: ClassVar[str]
    _request_class: ClassVar[type[EmptyRequest]]
    _response_class: ClassVar[type[EmptyResponse]]

class EmptyRequest(genpy.Message): ...

class EmptyResponse(genpy.Message): ...

class SetBool:
    _type: ClassVar[str]
    _md5sum: ClassVar[str]
    _request_class: ClassVar[type[SetBoolRequest]]
    _response_class: ClassVar[type[SetBoolResponse]]

class SetBoolRequest(genpy.Message):
    data: bool = ...

class SetBoolResponse(genpy.Message):
    success: bool = ...
    message: str = ...

class Trigger:
    _type: ClassVar[str]
    _md5sum: ClassVar[str]
    _request_class: ClassVar[type[TriggerRequest]]
    _response_class: ClassVar[type[TriggerResponse]]

class TriggerRequest(genpy.Message): ...

class TriggerResponse(genpy.Message):
    success: bool = ...
    message: str = ...
