"""The audit log of an arm by the node's parameters, and its first line."""
import dataclasses
import getpass
import logging
import os
import platform
import re
from typing import Any, Dict, Optional

import rospy

from jaka_ros_driver.audit.log import AuditLog
from jaka_ros_driver.protocol.ports import endpoint
from jaka_ros_driver.ros.audit.plain import plain
from jaka_ros_driver.ros.params import AUDIT_DIR_AUTO, DriverConfig
from jaka_ros_driver.ros.topics.diagnostics import package_version

_LOG = logging.getLogger(__name__)


def audit_log_of(config: DriverConfig) -> Optional[AuditLog]:
    """Return the log of the arm of this configuration, which does not write yet; None where the owner wants none."""
    if not config.audit_dir:
        _LOG.warning("the audit log is switched off by ~audit_dir: nobody records who does what with the arm")
        return None
    return AuditLog(folder_of(config), config.audit_days)


def folder_of(config: DriverConfig) -> str:
    """Return the folder of the log: one for each controller, as there is one driver for each.

    By default it is beside, and not below, the folder of ROS logs, which ``rosclean`` empties.
    """
    folder = config.audit_dir
    if folder == AUDIT_DIR_AUTO:
        folder = os.path.join(os.environ.get("ROS_HOME") or os.path.join("~", ".ros"), "jaka_audit")
    controller = "%s_%d" % (re.sub(r"[^A-Za-z0-9.-]", "_", config.ip), config.command_port)
    return os.path.join(os.path.expanduser(folder), controller)


def start_fields(config: DriverConfig) -> Dict[str, Any]:
    """Return the fields of a start line: what runs where, with which parameters."""
    return {
        "version": package_version(), "node": rospy.get_name(), "process": os.getpid(), "user": _user(),
        "machine": platform.node(), "python": platform.python_version(), "model": config.model,
        "controller": endpoint(config.ip, config.command_port),
        "parameters": {field.name: plain(getattr(config, field.name)) for field in dataclasses.fields(config)}}


def _user() -> str:
    try:
        return getpass.getuser()
    except Exception:  # a user id without a name
        return str(os.getuid())
