"""The note that a controller had a driver since the computer was switched on: a restart powers no arm by itself."""
import json
import logging
from typing import List, Optional

from jaka_ros_driver.client.process_state import boot
from jaka_ros_driver.client.runtime_file import RuntimeFile

_LOG = logging.getLogger(__name__)


def is_first_start(host: str, command_port: int, folders: Optional[List[str]] = None) -> bool:
    """Note that a driver of this controller starts; return whether it is the first one since the computer started.

    False, too, where that is not known, as of a note that cannot be read, or cannot be noted: the next start would be
    taken for the first one.

    Args:
        host: The controller's address.
        command_port: Its command port.
        folders: Folders for the note; None for the runtime folders.
    """
    file = RuntimeFile("started", host, command_port, folders)
    try:
        now = boot()
        noted = file.read(lambda text: str(json.loads(text)["boot"]))
        file.write(json.dumps({"controller": file.controller, "boot": now}))
    except OSError as error:
        _LOG.warning("it cannot be noted that the driver of %s has started: %s", file.controller, error)
        return False
    return now not in noted and None not in noted
