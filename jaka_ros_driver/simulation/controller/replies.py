"""Replies of the command port, and the refusals that handlers raise (docs/controller-protocol.md sections 3.2, 4.3)."""
from typing import Any, Dict

from jaka_ros_driver.protocol.framing import encode_object
from jaka_ros_driver.protocol.status import encode_frame

Reply = Dict[str, Any]

SERVO_ONLY = "%s command can only be excuted in servo move mode"
"""The vendor's words, misspelling included, as captured for ``servoj`` (docs/controller-protocol.md section 4.3)."""


class Refused(Exception):
    """The command is understood but not carried out. It becomes a reply.

    Attributes:
        code: The reply's errorCode.
        message: The reply's errorMsg; None stands for the vendor's "call <cmd> failed".
    """

    def __init__(self, code: str = "2", message: str = "") -> None:
        super().__init__(code, message)
        self.code = code
        self.message = message


class BadParameter(Exception):
    """A parameter is missing or of the wrong type; the reply is that to an unknown command."""


def accepted(command: str, fields: Reply) -> bytes:
    """The reply to an accepted command; its own fields come first."""
    reply = {**fields, "errorCode": "0", "errorMsg": "", "cmdName": command}
    return encode_frame(reply) if "len" in reply else encode_object(reply)


def refused(command: str, refusal: Refused) -> bytes:
    """The reply to a command that was understood and refused."""
    message = refusal.message or "call %s failed" % command
    return encode_object({"errorCode": refusal.code, "errorMsg": message, "cmdName": command})


def not_understood() -> bytes:
    """The reply to an unknown command, a wrong parameter type, and what is no JSON; it does not name the command."""
    return encode_object({"errorCode": "1", "errorMsg": "Exception:function call failed"})
