import io

import genpy

class AnyMsg(genpy.Message):
    _buff: bytes
    def __init__(self, *args: bytes) -> None: ...

def serialize_message(b: io.BytesIO, seq: int, msg: genpy.Message) -> None: ...
