"""One message as Python values: what a definition makes of few bytes is limited."""
import struct
import time

import numpy as np
import pytest

from jaka_bag.errors import DefinitionError
from jaka_bag.messages.batch import MessageBatch
from jaka_bag.messages.cdr import CdrConverter
from jaka_bag.messages.connection import Connection
from jaka_bag.messages.decoding import Decoder
from jaka_bag.messages.values import ValueReader

BREAK = "=" * 80
SOON_S = 1.0


def nested(depth, length, inner=""):
    """Return a definition of fixed arrays of messages in fixed arrays of messages, the innermost with ``inner``."""
    types = ["MSG: a/T%d\na/T%d[%d] x\n" % (i, i + 1, length) for i in range(1, depth)] + [
        "MSG: a/T%d\n%s" % (depth, inner)]
    return "a/T1[%d] x\nuint8[300] pad\n" % length + "".join("%s\n%s" % (BREAK, text) for text in types)


@pytest.mark.parametrize("definition", [
    nested(8, 200), nested(3, 200), nested(3, 100), nested(8, 200, "uint8 x\n"), nested(20, 999999999),
    "a/Some[300] x\n%s\nMSG: a/Some\nuint8 x\n%s%s\nMSG: a/None\n" % (
        BREAK, "".join("None n%d\n" % i for i in range(4000)), BREAK)], ids=range(6))
def test_few_bytes_do_not_become_values_without_end(definition):
    connection = Connection("/h", "a/T0", definition=definition)
    begin = time.process_time()
    for kind, read in ((ValueReader, ValueReader.read), (Decoder, Decoder.decode)):
        with pytest.raises(DefinitionError):
            read(kind(connection), bytes(300))
    assert time.process_time() - begin < 2 * SOON_S


@pytest.mark.parametrize("inner", ["", "uint8 x\n"])
def test_cdr_has_no_fixed_arrays_without_end_either(inner):
    begin = time.process_time()
    own = Connection("/h", "a/msg/T0", definition=nested(4, 200, inner), encoding="cdr", schema_encoding="ros2msg")
    with pytest.raises(DefinitionError):
        ValueReader(own).read(b"\0\1\0\0" + bytes(300))
    batch = MessageBatch(np.zeros(300, np.uint8), np.zeros(1, np.int64), np.full(1, 300), np.zeros(1, np.int32),
                         np.zeros(1, np.int64))
    with pytest.raises(DefinitionError):
        CdrConverter(Connection("/h", "a/T0", definition=nested(4, 200, inner))).convert(batch, np.zeros(1, np.int64))
    assert time.process_time() - begin < 4 * SOON_S


def test_arrays_of_messages_without_bytes_and_long_arrays_are_read():
    empty = ValueReader(Connection("/e", "a/B", definition="None[] x\nNone y\n%s\nMSG: a/None\nint32 A=3\n" % BREAK))
    assert empty.read(struct.pack("<I", 50)) == {"x": [{}] * 50, "y": {}}
    points = ValueReader(Connection("/p", "a/B", definition="P[] p\n%s\nMSG: a/P\nQ q\n%s\nMSG: a/Q\nuint8 x\n" % (
        BREAK, BREAK)))
    assert points.read(struct.pack("<I", 50000) + bytes([7]) * 50000) == {"p": [{"q": {"x": 7}}] * 50000}
