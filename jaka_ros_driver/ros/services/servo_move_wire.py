"""The maker's own definition of ServoMove.srv, for clients that were built with it.

It has a second request field ``float32[] speed``, which its driver does not use (docs/interface.md section 5)::

    float32[] pose
    float32[] speed
    ---
    int16 ret
    string message
"""
import struct
from typing import Any, BinaryIO, List, Sequence, Tuple

import genpy

from jaka_msgs.srv import ServoMove, ServoMoveRequest, ServoMoveResponse


class ServoMoveWithSpeedRequest(genpy.Message):
    """The request: ``pose``, and ``speed``, which is kept for the record of the call and not used."""

    _type = ServoMoveRequest._type
    _md5sum = "0da71b9828204eece05ec950e45db9d9"
    _has_header = False
    _full_text = "float32[] pose\nfloat32[] speed\n"
    __slots__ = ["pose", "speed"]
    _slot_types = ["float32[]", "float32[]"]

    pose: Sequence[float]
    speed: Sequence[float]

    def __init__(self, *args: Any, **kwds: Any) -> None:
        super().__init__(*args, **kwds)
        self.pose = self.pose or []
        self.speed = self.speed or []

    def _get_types(self) -> List[str]:
        return self._slot_types

    def serialize(self, buff: BinaryIO) -> None:
        for values in (self.pose, self.speed):
            buff.write(struct.pack("<I%df" % len(values), len(values), *values))

    def deserialize(self, str: bytes) -> "ServoMoveWithSpeedRequest":
        try:
            self.pose, end = _floats(str, 0)
            self.speed, _ = _floats(str, end)
        except struct.error as error:
            raise genpy.DeserializationError(error) from error
        return self


class ServoMoveWithSpeed:
    """The service type with that request."""

    _type = ServoMove._type
    _md5sum = "ea058e08a9ca2790743a486fd4bfb151"
    _request_class = ServoMoveWithSpeedRequest
    _response_class = ServoMoveResponse


def _floats(data: bytes, start: int) -> Tuple[Tuple[float, ...], int]:
    (count,) = struct.unpack_from("<I", data, start)
    values = struct.unpack_from("<%df" % count, data, start + 4)
    return values, start + 4 + 4 * count
