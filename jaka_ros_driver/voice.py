"""The former name of ``background_log.StandardErrorLog``, for ``bags`` until it has a way of its own."""
from jaka_ros_driver.background_log import StandardErrorLog


class Voice(StandardErrorLog):
    """Lines on standard error that nobody waits for."""

    say = StandardErrorLog.write
