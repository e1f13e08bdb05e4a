"""The replies of the command port, and the refusals of handlers (docs/controller-protocol.md sections 3.2, 4.3)."""
from typing import Any, Dict

from jaka_ros_driver.protocol.framing import encode_object
from jaka_ros_driver.protocol.status import encode_frame
from jaka_ros_driver.simulation.dialect.table import Dialect

Reply = Dict[str, Any]

WHOLE_FRAME = "get_data"
"""The command whose reply is a status frame, with ``len`` (docs/controller-protocol.md section 5.13)."""
UNKNOWN_FIELDS: Reply = {"vendorTrace": {"hop": [1, 2.5, None], "tag": "{\\"}, "vendorFlags": [[True, []], {}]}
"""Fields that nobody asked for, as nested as JSON allows."""

SERVO_ONLY = "%s command can only be excuted in servo move mode"
"""The vendor's words, misspelling included, as captured for ``servoj`` (docs/controller-protocol.md section 4.3)."""


class CommandRefused(Exception):
    """The refusal of a command that is understood but not carried out. It becomes a reply.

    Attributes:
        code: The reply's errorCode.
        message: The reply's errorMsg; None stands for the vendor's "call <cmd> failed".
    """

    def __init__(self, code: str = "2", message: str = "") -> None:
        super().__init__(code, message)
        self.code = code
        self.message = message


class BadParameter(Exception):
    """The error of a missing or mistyped parameter; the reply is that to an unknown command."""


def accepted(dialect: Dialect, command: str, fields: Reply) -> bytes:
    """Return the reply to an accepted command; its own fields come first."""
    return _encoded(dialect, {**fields, "errorCode": "0", "errorMsg": "", "cmdName": command})


def refused(dialect: Dialect, command: str, refusal: CommandRefused) -> bytes:
    """Return the reply to a command that was understood and refused."""
    message = refusal.message or "call %s failed" % command
    return _encoded(dialect, {"errorCode": refusal.code, "errorMsg": message, "cmdName": command})


def not_understood(dialect: Dialect) -> bytes:
    """Return the reply to an unknown command, a wrong parameter type, and what is no JSON.

    It does not name the command.
    """
    return _encoded(dialect, {"errorCode": "1", "errorMsg": "Exception:function call failed"})


def _encoded(dialect: Dialect, reply: Reply) -> bytes:
    if dialect.error_code == "number":
        reply["errorCode"] = int(reply["errorCode"])
    if dialect.unknown_reply_fields:
        reply = {**UNKNOWN_FIELDS, **reply}
    return encode_frame(reply) if reply.get("cmdName") == WHOLE_FRAME else encode_object(reply)
