"""The description of one publisher's stream in a log."""
from typing import NamedTuple, Optional, Tuple


class Connection(NamedTuple):
    """One publisher's stream on one topic, as a log stores it.

    Attributes:
        topic: Topic name.
        datatype: ``package/Type``.
        md5sum: md5 of the type as the publisher announced it, lower-case hex; empty where the log has none.
        definition: Full text of the definition with those of all types in it (bytes that are not UTF-8
            are kept as surrogates).
        callerid: Name of the publishing node; None where the log has none.
        latching: The publisher latched; None where the log does not show it.
        extra: Further fields of the connection header, (name, value), in the log's order.
        encoding: Encoding of the messages (``ros1``, ``cdr``, ...).
        schema_encoding: Encoding of ``definition`` (``ros1msg``, ``ros2msg``, ...).
    """

    topic: str
    datatype: str
    md5sum: str = ""
    definition: str = ""
    callerid: Optional[str] = None
    latching: Optional[bool] = None
    extra: Tuple[Tuple[str, str], ...] = ()
    encoding: str = "ros1"
    schema_encoding: str = "ros1msg"
