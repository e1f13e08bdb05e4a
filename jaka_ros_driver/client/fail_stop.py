"""Fail-stop: the last stop and the evidence of a driver whose core has failed by a defect.

The stop goes out first, made without the core's help; then the evidence goes to a file. Nothing here raises.
"""
import contextlib
import logging
import os
import tempfile
import time
import traceback
from typing import Callable, List, Optional, Tuple

from jaka_ros_driver.client.core.arm_core import ArmCore
from jaka_ros_driver.commands import JogStop, whole_stop
from jaka_ros_driver.protocol import codec
from jaka_ros_driver.protocol.framing import encode_object

_LOG = logging.getLogger(__name__)

LAST_STOPS = 3
"""Number of stops of a driver whose core has failed: nobody reads the replies any more, and one may be refused."""
LAST_STOP_PERIOD_S = 0.1
"""Period, s, of the ``LAST_STOPS`` stops that a driver whose core has failed sends before it closes the connection."""


def last_stop(core: ArmCore) -> bytes:
    """Encode the stop for whatever motion the core had; empty where no confirmed link can carry it."""
    if not core.channel.is_open:
        return b""
    jog: Optional[JogStop] = None
    with contextlib.suppress(Exception):
        motion = core.custody.motion
        jog = None if motion is None else motion.halt()
    return b"".join([encode_object(codec.encode(command)) for command in whole_stop(jog)])


def report(core: ArmCore, defect: Exception) -> None:
    """Log that the core has failed and was stopped, with the defect, and where the evidence is."""
    _LOG.critical("the driver's core has failed, the arm is stopped", exc_info=defect)
    path = write_evidence(core, defect)
    _LOG.critical("its state is in %s", path or "no file: none could be written")


def write_evidence(core: ArmCore, error: BaseException, folder: str = "") -> Optional[str]:
    """Write the known state of a failed core into a new file; return its path, None where it could not be written.

    Args:
        core: The core that has failed; attributes that cannot be read any more are left out.
        error: The exception that came out of it.
        folder: Where the file goes; by default the folder of ROS logs, or that of temporary files.
    """
    lines = ["jaka_driver: the core has failed, the arm was stopped",
             time.strftime("%Y-%m-%d %H:%M:%S %z"), "",
             "".join(traceback.format_exception(type(error), error, error.__traceback__)), ""]
    known: Tuple[Tuple[str, Callable[[], object]], ...] = (
        ("custody", lambda: core.custody.describe()),
        ("owner", lambda: core.motion_owner),
        ("links", lambda: core.links.health()),
        ("feed", lambda: core.links.feed_health(time.monotonic())),
        ("newest state", lambda: core.state),
        ("monotonic time", time.monotonic))
    for name, read in known:
        try:
            lines.append("%s: %s" % (name, read()))
        except Exception as defect:
            lines.append("%s: cannot be read: %r" % (name, defect))
    for place in (folder,) if folder else (*_log_folders(), tempfile.gettempdir()):
        path = os.path.join(place, "jaka_driver_failure_%d_%d.txt" % (os.getpid(), time.time_ns()))
        with contextlib.suppress(OSError, ValueError), open(path, "x", encoding="utf-8", errors="replace") as file:
            file.write("\n".join(lines) + "\n")
            return path
    return None


def _log_folders() -> List[str]:
    """Return the folders in which ROS would keep its logs, the wanted one first; they may be missing."""
    environment = os.environ
    return [environment.get("ROS_LOG_DIR") or os.path.join(
        environment.get("ROS_HOME") or os.path.join(os.path.expanduser("~"), ".ros"), "log")]
