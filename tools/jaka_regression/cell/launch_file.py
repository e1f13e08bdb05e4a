"""The user's launch file: it starts the cell's own nodes, and neither a driver nor a simulated controller."""
import importlib
from pathlib import Path
from typing import Any, List, Sequence

from jaka_bag.errors import BagError

from ..scenario import Scenario

_OWN_PACKAGE = "jaka_ros_driver"
_OWN_EXECUTABLES = {"jaka_driver": "a driver", "jaka_sim": "a simulated controller"}


class LaunchFileError(BagError):
    """A launch file that cannot be loaded, or that starts what the test starts itself."""


def check_launch_file(path: Path, arguments: Sequence[str], scenario: Scenario) -> None:
    """Check that a launch file leaves drivers and simulated controllers to the test.

    Args:
        path: The launch file.
        arguments: Arguments for it, as ``driver:=false``.
        scenario: The arms whose drivers the test starts.

    Raises:
        LaunchFileError: It cannot be loaded, starts nothing, or starts a driver or a simulated controller.
    """
    if not path.is_file():
        raise LaunchFileError("there is no launch file %s" % path)
    try:
        roslaunch: Any = importlib.import_module("roslaunch")
    except ImportError as error:
        raise LaunchFileError("%s: a cell's nodes need ROS: %s" % (path, error)) from error
    try:
        config = roslaunch.config.load_config_default([(str(path), list(arguments))], None, verbose=False)
    except Exception as error:  # roslaunch has no common class for what it raises here
        raise LaunchFileError("%s: %s" % (path, " ".join(str(error).split()))) from error
    if not config.nodes:
        raise LaunchFileError("%s starts no node%s" % (path, " with " + " ".join(arguments) if arguments else ""))
    drivers = {arm.namespace + "/jaka_driver" for arm in scenario.arms}
    found: List[str] = []
    for node in config.nodes:
        name = node.namespace.rstrip("/") + "/" + node.name
        if node.package == _OWN_PACKAGE and node.type in _OWN_EXECUTABLES:
            found.append("%s (node %s)" % (_OWN_EXECUTABLES[node.type], name))
        elif name in drivers:
            found.append("a node of the driver's name, %s" % name)
    if found:
        raise LaunchFileError("%s starts %s: the test starts its own; leave it out with an argument of the launch "
                              "file, as driver:=false" % (path, ", ".join(found)))
