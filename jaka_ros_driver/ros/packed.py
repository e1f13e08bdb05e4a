"""Messages written as bytes by the layout of their type, for topics on which little but numbers changes.

A message object, filled and written by its generated class, costs three times as much as the same numbers written by a
layout that is known already. The driver would pay that for each frame of the feed and each topic of the state.
"""
import contextlib
import struct
from itertools import count
from operator import itemgetter
from typing import Any, Callable, Generic, Hashable, Iterator, Optional, Sequence, Tuple, TypeVar

import genpy
import rospy

_Message = TypeVar("_Message", bound=genpy.Message)
_CODES = {"bool": "B", "int8": "b", "byte": "b", "uint8": "B", "char": "B", "int16": "h", "uint16": "H", "int32": "i",
          "uint32": "I", "int64": "q", "uint64": "Q", "float32": "f", "float64": "d"}
_TIMES = {"time": "I", "duration": "i"}
_SEQ = "header.seq"
_LENGTH = struct.Struct("<I")


class PackedLayout:
    """The layout of the messages that have the texts, and arrays of the lengths, of an example.

    Attributes:
        fields: The names of the fields with numbers, in their order, without the header's seq. An array is one field.
        numbers: The example's, those of an array one by one.
    """

    def __init__(self, example: genpy.Message) -> None:
        """Read the layout off the type's ``_slot_types`` and the example's values."""
        parts = list(_parts(example, ""))
        seq = _SEQ if getattr(type(example), "_has_header", False) else None
        constants = [value for _, code, value in parts if code.endswith("s")]
        form = struct.Struct("<4s" + "".join(code for _, code, _ in parts) + "0s")
        self._constants = (_LENGTH.pack(form.size - _LENGTH.size), *constants, b"")
        self.numbers = tuple(value for name, code, value in parts if not code.endswith("s") and name != seq)
        self.fields = tuple(dict.fromkeys(name for name, _, _ in parts if name and name != seq))
        constant, number = count(1), count(len(self._constants) + 1)
        places = [next(constant) if code.endswith("s") else len(self._constants) if name == seq else next(number)
                  for name, code, _ in parts]
        self._in_order = itemgetter(0, *places, len(self._constants) - 1)
        self._pack = form.pack

    def pack(self, seq: int, numbers: Tuple[Any, ...]) -> bytes:
        """Return a message as it is sent: its length, and the bytes that its generated class writes.

        Args:
            seq: Of its header; without effect where it has none.
            numbers: As many as the example's.

        Raises:
            genpy.SerializationError: There are more or fewer, or one is no number, or outside the range of its type.
            OverflowError: One is outside the range of a float32.
        """
        if len(numbers) != len(self.numbers):
            raise genpy.SerializationError("%d numbers for the fields %s; valid: %d" % (
                len(numbers), ", ".join(self.fields), len(self.numbers)))
        try:
            return self._pack(*self._in_order(self._constants + (seq,) + numbers))
        except struct.error as error:
            raise genpy.SerializationError("%s, of the numbers %s for the fields %s" % (
                error, numbers, ", ".join(self.fields))) from error


def _parts(value: Any, name: str) -> Iterator[Tuple[str, str, Any]]:
    """Yield the name, the code for ``struct`` and the value of each part of a message; a text has no name."""
    for slot, kind in zip(value.__slots__, value._slot_types):
        yield from _parts_of_field(getattr(value, slot), kind, name + slot)


def _parts_of_field(value: Any, kind: str, name: str) -> Iterator[Tuple[str, str, Any]]:
    if kind in _CODES:
        yield name, _CODES[kind], value
    elif kind in _TIMES:
        yield name + ".secs", _TIMES[kind], value.secs
        yield name + ".nsecs", _TIMES[kind], value.nsecs
    elif kind == "string":
        yield _constant("", _with_length(value.encode() if isinstance(value, str) else value))
    elif kind.endswith("]"):
        element, _, length = kind[:-1].partition("[")
        if not length:
            yield _constant(name if element in _CODES else "", _LENGTH.pack(len(value)))
        for index, each in enumerate(value):
            yield from _parts_of_field(each, element, name if element in _CODES else "%s[%d]" % (name, index))
    else:
        yield from _parts(value, name + ".")


def _constant(name: str, data: bytes) -> Tuple[str, str, bytes]:
    return name, "%ds" % len(data), data


def _with_length(data: bytes) -> bytes:
    return _LENGTH.pack(len(data)) + data


class PackedTopic(Generic[_Message]):
    """A topic, not a latched one, whose messages differ in numbers alone most of the time; for one thread."""

    def __init__(self, publisher: "rospy.Publisher[_Message]", fields: Sequence[str]) -> None:
        """Set up the topic.

        Args:
            publisher: Of its messages; whoever has it may publish others with it.
            fields: The fields of the numbers that ``publish`` is given, as ``PackedLayout.fields`` names them. Where
                the installed type has others, messages are published as rospy does it.
        """
        self._publisher = publisher
        self._fields = tuple(fields)
        self._shape: Hashable = None
        self._layout: Optional[PackedLayout] = None

    def is_heard(self) -> bool:
        """Return whether anybody subscribes to it."""
        return bool(self._publisher.impl.connections)

    def publish(self, shape: Hashable, make: Callable[[], _Message], numbers: Tuple[Any, ...]) -> None:
        """Publish a message.

        Args:
            shape: Tells messages with other texts, or arrays of other lengths, from those before; not None.
            make: Makes the message; called where the shape is another one than the last.
            numbers: Those of the message, its header's seq left out.

        Raises:
            rospy.ROSException: A number is outside the range of its type, as rospy raises it.
        """
        if shape != self._shape:
            layout = PackedLayout(make())
            self._shape, self._layout = shape, layout if layout.fields == self._fields else None
        if self._layout is None:
            self._publisher.publish(make())
            return
        impl = self._publisher.impl
        lock = impl.publock
        if lock is None or impl.closed:  # the node ends
            return
        with lock:
            impl.seq += 1
            try:
                data = self._layout.pack(impl.seq, numbers)
            except genpy.SerializationError as error:
                raise rospy.ROSSerializationException("%s: %s" % (self._publisher.name, error)) from error
            for connection in impl.connections:  # a list that is never changed, only replaced
                try:
                    connection.write_data(data)
                except Exception:  # it is closed: that is how rospy takes it, too
                    with contextlib.suppress(Exception):
                        connection.close()
            impl.message_data_sent += len(data)
