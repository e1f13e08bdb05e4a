"""Definitions of jaka_msgs types with which clients may have been built, beside the installed ones.

``ServoMove`` has one documented request field (docs/interface.md section 4), and a second one, which no driver uses, in
the maker's published packages (JakaCobot/jaka_robot, src/jaka_msgs and jaka_robot_v2.2/src/jaka_msgs)::

    float32[] pose
    float32[] speed
    ---
    int16 ret
    string message

``clear_err`` is documented as a ``ClearErr``; the published packages have a ``ClearError`` with a request field
``bool enable`` instead. Whichever of them is installed, clients of the others are served, too.
"""
import struct
from typing import Any, BinaryIO, ClassVar, Dict, List, Sequence, Tuple

import genpy
from std_srvs.srv import EmptyRequest

from jaka_ros_driver.ros.jaka_types import AbsentType
from jaka_ros_driver.ros.jaka_types import services as types
from jaka_ros_driver.ros.other_messages import service_class


class _FloatArrays(genpy.Message):
    """A request whose fields are all ``float32[]``."""

    _type = "jaka_msgs/ServoMoveRequest"
    _has_header = False
    __slots__: ClassVar[List[str]] = []
    _slot_types: ClassVar[List[str]] = []

    def __init__(self, *args: Any, **kwds: Any) -> None:
        super().__init__(*args, **kwds)
        for name in self.__slots__:
            setattr(self, name, getattr(self, name) or [])

    def _get_types(self) -> List[str]:
        return self._slot_types

    def serialize(self, buff: BinaryIO) -> None:
        for name in self.__slots__:
            values = getattr(self, name)
            buff.write(struct.pack("<I%df" % len(values), len(values), *values))

    def deserialize(self, str: bytes) -> "_FloatArrays":
        end = 0
        try:
            for name in self.__slots__:
                values, end = _floats(str, end)
                setattr(self, name, values)
        except struct.error as error:
            raise genpy.DeserializationError(error) from error
        return self


class ServoMovePoseRequest(_FloatArrays):
    """The documented request: ``pose`` alone."""

    _md5sum = "7a3c06210d198810ca95bf78d389f526"
    _full_text = "float32[] pose\n"
    __slots__ = ["pose"]
    _slot_types = ["float32[]"]

    pose: Sequence[float]


class ServoMoveWithSpeedRequest(_FloatArrays):
    """The maker's request: ``pose``, and ``speed``, which is kept for the record of the call and not used."""

    _md5sum = "0da71b9828204eece05ec950e45db9d9"
    _full_text = "float32[] pose\nfloat32[] speed\n"
    __slots__ = ["pose", "speed"]
    _slot_types = ["float32[]", "float32[]"]

    pose: Sequence[float]
    speed: Sequence[float]


class ServoMoveAnyRequest(ServoMoveWithSpeedRequest):
    """The request of a client that names no definition (md5 ``*``): it may end behind ``pose``."""

    def deserialize(self, str: bytes) -> "ServoMoveAnyRequest":
        try:
            is_pose_alone = _floats(str, 0)[1] == len(str)
        except struct.error as error:
            raise genpy.DeserializationError(error) from error
        super().deserialize(str + bytes(4) if is_pose_alone else str)
        return self


_POSE_MD5 = "7dad889723cef7fc192c47c7bdf495f2"
_WITH_SPEED_MD5 = "ea058e08a9ca2790743a486fd4bfb151"
_CLEAR_ERR_MD5 = "76c68a2c5e109f4d6a4dc1cfc355f405"


def other_definitions(srv_type: Any) -> Dict[str, Any]:
    """Return the further definitions whose clients a service of a generated type takes, by the md5 that they send."""
    response = srv_type._response_class
    if srv_type is types.ClearErr:
        other = types.ClearError
        return {} if isinstance(other, AbsentType) else {other._md5sum: other}
    if srv_type is types.ClearError:
        return {_CLEAR_ERR_MD5: service_class("jaka_msgs/ClearErr", _CLEAR_ERR_MD5, EmptyRequest, response)}
    if srv_type is not types.ServoMove:
        return {}
    found = {md5sum: service_class(srv_type._type, md5sum, request, response)
             for md5sum, request in ((_POSE_MD5, ServoMovePoseRequest), (_WITH_SPEED_MD5, ServoMoveWithSpeedRequest))
             if md5sum != srv_type._md5sum}
    if srv_type._md5sum == _WITH_SPEED_MD5:
        found["*"] = service_class(srv_type._type, _WITH_SPEED_MD5, ServoMoveAnyRequest, response)
    return found


def _floats(data: bytes, start: int) -> Tuple[Tuple[float, ...], int]:
    (count,) = struct.unpack_from("<I", data, start)
    values = struct.unpack_from("<%df" % count, data, start + 4)
    return values, start + 4 + 4 * count
