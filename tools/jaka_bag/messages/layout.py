"""The positions of fields in serialised ROS 1 messages: messages of one layout are handled together.

``DefinitionError`` is raised where the definition is not understood or does not describe a message.
"""
import struct
from typing import Dict, Iterator, List, NamedTuple, Optional, Tuple

import numpy as np

from ..errors import DefinitionError
from .batch import Array, MessageBatch, converted, distinct, rows
from .connection import Connection
from .definitions import PRIMITIVE_SIZES, MessageType, least_size
from .encodings import as_ros1, ros1_form, types_of

_U32 = struct.Struct("<I")
_MAX_CACHED = 256
"""Layouts that are known again; messages of ever new lengths must not fill the memory."""
_MOST_EMPTY = 10000
"""Largest array of messages without bytes: its length says nothing that the message's bytes bound."""
_MOST_VALUES = 2000000
"""Values that the arrays of messages in one message may hold, and fields that it may have, together."""


class Leaf(NamedTuple):
    """One field without fields of its own, in all places where a layout has it.

    Attributes:
        type: A key of ``PRIMITIVE_SIZES`` or ``string``.
        offsets: First byte of each run of values.
        counts: Values of each run; bytes for a string.
        is_array: True where a message may hold other than one value.
    """

    type: str
    offsets: Tuple[int, ...]
    counts: Tuple[int, ...]
    is_array: bool


def is_bytes(leaf: Leaf) -> bool:
    """Return whether a field is an array of bytes, which belong together rather than being numbers of their own."""
    return leaf.is_array and leaf.type in ("uint8", "char", "byte", "int8")


class Layout:
    """The position of each field in all messages that have the same lengths of strings and arrays.

    Attributes:
        length: Bytes of a message.
        lengths_at: Positions of the bytes that hold lengths, int64.
        lengths: The values of those bytes, uint8.
        leaves: Fields by dotted name.
    """

    def __init__(self, length: int, lengths_at: Array, lengths: Array, leaves: Dict[str, Leaf]) -> None:
        self.length = length
        self.lengths_at = lengths_at
        self.lengths = lengths
        self.leaves = leaves


class _Walker:
    """A walk over one message along its definition."""

    def __init__(self, types: Dict[str, MessageType], raw: bytes) -> None:
        self._types = types
        self._raw = raw
        self._left = _MOST_VALUES
        self._least: Dict[str, int] = {}
        self.at = 0
        self.lengths_at: List[int] = []
        self.runs: Dict[str, Tuple[str, List[int], List[int], bool]] = {}

    def _count_one(self) -> None:
        self._left -= 1
        if self._left < 0:
            raise DefinitionError("a message has more than %d values" % _MOST_VALUES)

    def _length(self) -> int:
        if self.at + 4 > len(self._raw):
            raise DefinitionError("a message is shorter than its definition says")
        self.lengths_at.extend(range(self.at, self.at + 4))
        self.at += 4
        return int(_U32.unpack_from(self._raw, self.at - 4)[0])

    def _leaf(self, name: str, type_name: str, count: int, size: int, is_array: bool) -> None:
        if self.at + count * size > len(self._raw):
            raise DefinitionError("a message is shorter than its definition says")
        self._count_one()
        run = self.runs.setdefault(name, (type_name, [], [], is_array))
        run[1].append(self.at)
        run[2].append(count)
        self.at += count * size

    def walk(self, datatype: str, prefix: str, is_array: bool) -> None:
        for field in self._types[datatype].fields:
            name = prefix + field.name
            count = 1 if field.array is None else self._length() if field.array < 0 else field.array
            in_array = is_array or field.array is not None
            size = PRIMITIVE_SIZES.get(field.type)
            if size is not None:
                self._leaf(name, field.type, count, size, in_array)
                continue
            least = least_size(field.type, self._types, self._least)
            if count * least > len(self._raw):
                raise DefinitionError("a message is shorter than its definition says")
            if least == 0:  # messages of nothing but constants have no bytes
                if count > _MOST_EMPTY:
                    raise DefinitionError("a message has an array of %d empty messages" % count)
                if field.array is not None and field.array < 0:  # their number is all that they say
                    self.at -= 4
                    self._leaf(name, "uint32", 1, 4, is_array)
                continue
            self._count_one()
            if count == 0:
                self._declare(field.type, name)
            for _ in range(count):
                if field.type == "string":
                    self._leaf(name, "string", self._length(), 1, in_array)
                else:
                    self.walk(field.type, name + ".", in_array)

    def _declare(self, type_name: str, name: str) -> None:
        """Name the leaves of an array that is empty in this message."""
        self._count_one()
        if type_name == "string" or type_name in PRIMITIVE_SIZES:
            self.runs.setdefault(name, (type_name, [], [], True))
            return
        for field in self._types[type_name].fields:
            is_empty = field.array is not None and field.array < 0 and not least_size(
                field.type, self._types, self._least)
            self._declare("uint32" if is_empty else field.type, "%s.%s" % (name, field.name))


def layout_of(datatype: str, types: Dict[str, MessageType], raw: bytes) -> Layout:
    """Return the layout of one message."""
    walker = _Walker(types, raw)
    walker.walk(datatype, "", False)
    if walker.at != len(raw):
        raise DefinitionError("a message has %d bytes, its definition describes %d" % (len(raw), walker.at))
    at = np.array(walker.lengths_at, np.int64)
    leaves = {name: Leaf(kind, tuple(offsets), tuple(counts), is_array)
              for name, (kind, offsets, counts, is_array) in walker.runs.items()}
    return Layout(len(raw), at, np.frombuffer(raw, np.uint8)[at], leaves)


class Group(NamedTuple):
    """Messages of one layout: their positions in the batch, and their bytes, uint8, shape (n, layout.length)."""

    layout: Layout
    which: Array
    rows: Array


class LayoutFinder:
    """A sorter of one connection's messages by layout.

    Args:
        connection: Connection whose definition is followed, whatever its md5.
    """

    def __init__(self, connection: Connection) -> None:
        self._topic = connection.topic
        self._form = ros1_form(connection)
        self._datatype = as_ros1(connection).datatype
        self._types = types_of(connection)
        self._known: Dict[int, List[Layout]] = {}
        self._count = 0

    def _new_layout(self, raw: bytes) -> Layout:
        try:
            return layout_of(self._datatype, self._types, raw)
        except DefinitionError as error:
            raise DefinitionError("%s (%s): %s" % (self._topic, self._datatype, error)) from error

    def leaf(self, name: str) -> Optional[Leaf]:
        """Return a field from one of the layouts met so far; None where it was not met."""
        return next((layout.leaves[name] for known in self._known.values() for layout in known
                     if name in layout.leaves), None)

    def groups(self, batch: MessageBatch, which: Array) -> Iterator[Group]:
        """Yield the messages at positions ``which`` of a batch, by layout; those of another encoding as ROS 1's."""
        if self._form is not None:
            try:
                made = converted(batch, which, self._form.convert)
            except DefinitionError as error:
                raise DefinitionError("%s (%s): %s" % (self._topic, self._datatype, error)) from error
            for group in self._groups(made, np.arange(len(made))):
                yield group._replace(which=which[group.which])
        else:
            yield from self._groups(batch, which)

    def _groups(self, batch: MessageBatch, which: Array) -> Iterator[Group]:
        length = batch.length[which]
        for size in distinct(length).tolist():
            rest = which[length == size]
            matrix = rows(batch, rest, size)
            known = self._known.setdefault(size, [])
            untried = iter(known[:])
            while len(rest):
                layout = next(untried, None)
                if layout is None:
                    layout = self._new_layout(matrix[0].tobytes())
                    if self._count < _MAX_CACHED:
                        known.append(layout)
                        self._count += 1
                alike = matrix[:, layout.lengths_at] == layout.lengths
                if alike.all():
                    yield Group(layout, rest, matrix)
                    break
                fits = alike.all(axis=1)
                if fits.any():
                    yield Group(layout, rest[fits], matrix[fits])
                    rest, matrix = rest[~fits], matrix[~fits]
