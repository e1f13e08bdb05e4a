"""Messages of accidents, as the driver sends them: states, service calls, diagnostics."""
import struct
from typing import Dict, Optional

from log_samples import BREAK, HEADER, STATES, connection, text

from jaka_bag.messages.connection import Connection
from jaka_bag.messages.definitions import definition_md5

__all__ = ("CALLS", "DIAGNOSTICS", "STATES", "call", "diagnostics", "states")

CALLS = connection("/jaka_driver/service_calls", "jaka_msgs/ServiceCall",
                   "Header header\nstring service\nstring service_type\nstring md5sum\nstring caller\nuint8[] request\n"
                   "uint8[] response\nstring request_text\nstring response_text\nfloat64 duration\nbool success\n"
                   "string error\n" + HEADER, "/jaka_driver", False)
_STATUS = ("byte OK=0\nbyte WARN=1\nbyte ERROR=2\nbyte STALE=3\nbyte level\nstring name\nstring message\n"
           "string hardware_id\nKeyValue[] values\n")
_DIAGNOSTICS_TEXT = ("Header header\nDiagnosticStatus[] status\n" + HEADER + BREAK
                     + "MSG: diagnostic_msgs/DiagnosticStatus\n" + _STATUS + BREAK
                     + "MSG: diagnostic_msgs/KeyValue\nstring key\nstring value\n")
DIAGNOSTICS = Connection("/diagnostics", "diagnostic_msgs/DiagnosticArray",
                         definition_md5("diagnostic_msgs/DiagnosticArray", _DIAGNOSTICS_TEXT), _DIAGNOSTICS_TEXT,
                         "/jaka_driver", False)


def states(*values: int) -> bytes:
    return struct.pack("<4h", *values)


def call(service: str, success: bool, error: str = "", caller: str = "/cell", seq: int = 1, time_ns: int = 0,
         duration: float = 0.25) -> bytes:
    return (struct.pack("<III", seq, *divmod(time_ns, 10**9)) + text("") + text(service) + text("jaka_msgs/Move")
            + text("0" * 32) + text(caller) + struct.pack("<I", 2) + b"rq" + struct.pack("<I", 0) + text("mvvelo: 1.0")
            + text("ret: %d" % success) + struct.pack("<d?", duration, success) + text(error))


def diagnostics(levels: Dict[str, int], seq: int = 1, values: Optional[Dict[str, str]] = None,
                time_ns: int = 0) -> bytes:
    values = values or {}
    body = struct.pack("<III", seq, *divmod(time_ns, 10**9)) + text("") + struct.pack("<I", len(levels))
    for name, level in levels.items():
        body += struct.pack("<b", level) + text(name) + text("level %d" % level) + text("hw")
        body += struct.pack("<I", len(values)) + b"".join(text(key) + text(value) for key, value in values.items())
    return body
