"""The exit codes of ``jaka_driver``, by which a supervisor knows why a driver does not run.

The table in docs/operation.md is the output of ``python3 -m jaka_ros_driver.ros.exit_codes``.
"""
from typing import Dict, Tuple, Type

from jaka_ros_driver.ros.driver_lock import AlreadyDriven
from jaka_ros_driver.ros.start_checks import Unreachable

ENDED, DEFECT, CONFIGURATION, RIVAL, UNREACHABLE, COMPUTER = range(6)

MEANINGS: Dict[int, Tuple[str, str]] = {
    ENDED: ("ended in good order, by a signal or a shutdown request", "nothing"),
    DEFECT: ("a defect of the driver, which has stopped the arm as far as it could",
             "start it again; send the log and the file of evidence that it names"),
    CONFIGURATION: ("a wrong parameter, model file, zone file or option", "correct what the message names"),
    RIVAL: ("another driver has this controller, or a node has this name",
            "end that one; a second arm needs a name, `__ns:=/left`"),
    UNREACHABLE: ("clients cannot reach the node, nobody could stop the arm through it",
                  "set `ROS_IP` or `ROS_HOSTNAME`"),
    COMPUTER: ("the computer or the ROS master fails: a socket, a file, a connection", "see the message, start again"),
}
"""Meaning and remedy of each code."""
_OF_ERRORS: Tuple[Tuple[Type[Exception], int], ...] = (
    (AlreadyDriven, RIVAL), (Unreachable, UNREACHABLE), (OSError, COMPUTER))


def exit_code_of(error: Exception) -> int:
    """Return the exit code of a driver that cannot start because of this ``JakaError`` or OSError."""
    return next((code for kind, code in _OF_ERRORS if isinstance(error, kind)), CONFIGURATION)


def markdown() -> str:
    """Return the table of the codes for docs/operation.md."""
    rows = ["| %d | %s | %s |" % (code, *texts) for code, texts in MEANINGS.items()]
    return "\n".join(["| code | meaning | remedy |", "|---|---|---|", *rows]) + "\n"


if __name__ == "__main__":
    print(markdown(), end="")
