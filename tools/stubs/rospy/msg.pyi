import genpy

class AnyMsg(genpy.Message):
    _buff: bytes
    def __init__(self, *args: bytes) -> None: ...
