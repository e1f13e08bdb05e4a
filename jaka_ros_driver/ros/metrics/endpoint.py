"""The endpoint for Prometheus as the node starts it, with or without the library that it needs."""
from typing import Optional

from jaka_ros_driver.audit.log import AuditLog
from jaka_ros_driver.client.arm_client import ArmClient
from jaka_ros_driver.protocol.ports import endpoint
from jaka_ros_driver.ros.metrics.page_server import PageServer
from jaka_ros_driver.ros.params import DriverConfig, WrongParameter


def metrics_of(arm: ArmClient, config: DriverConfig, audit: Optional[AuditLog], version: str) -> Optional[PageServer]:
    """Return the server of the figures, which listens and does not serve yet; None where ``~metrics_port`` is 0.

    Raises:
        WrongParameter: Python's prometheus_client is not installed.
        OSError: The port cannot be had.
    """
    if not config.metrics_port:
        return None
    try:
        from jaka_ros_driver.ros.metrics.figures import Figures
    except ModuleNotFoundError as error:
        if (error.name or "").split(".")[0] != "prometheus_client":
            raise
        raise WrongParameter(
            "parameter ~metrics_port is %d, and Python's prometheus_client is not installed: apt install "
            "python3-prometheus-client, or pip install prometheus_client; without ~metrics_port nothing needs it"
            % config.metrics_port) from None
    figures = Figures(arm, config, audit, version)
    try:
        server = PageServer(config.metrics_address, config.metrics_port, figures.page)
    except OSError as error:
        raise OSError(error.errno, "the figures for Prometheus (~metrics_address, ~metrics_port) cannot be served at "
                      "%s: %s" % (endpoint(config.metrics_address, config.metrics_port), error.strerror)) from None
    figures.start()
    return server
