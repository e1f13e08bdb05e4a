"""The watch over the ROS master: after its restart the node is registered again, because a new master knows no nodes.

A restart is noticed by the master's ``/run_id``, which changes with every start. The registration is rospy's own;
existing connections are left as they are.
"""
import logging
import threading
from typing import Callable
from xmlrpc.client import Error as XmlRpcError

import rosgraph
import rospy
from rospy.impl import registration

_LOG = logging.getLogger(__name__)

_PERIOD_S = 1.0


class MasterWatch:
    """The poller of the master that registers all publishers, subscribers and services again after its restart."""

    def __init__(self, on_new_master: Callable[[], None], period: float = _PERIOD_S) -> None:
        """Set up the poller; ``start`` begins.

        Args:
            on_new_master: Called after the registration, to set parameters again: a new master has lost them, too.
            period: Of the polling, s.
        """
        self._on_new_master = on_new_master
        self._period = period
        self._closing = threading.Event()
        self._run_id = ""
        self._thread = threading.Thread(target=self._run, name="master watch", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def close(self) -> None:
        """Stop polling; a running call to the master is not waited for."""
        self._closing.set()

    def _run(self) -> None:
        while True:
            try:
                if self._is_new_master():
                    _LOG.warning("the ROS master was restarted; registering with the new one")
                    register_all()
                    self._on_new_master()
            except (OSError, XmlRpcError, rosgraph.MasterException) as error:
                _LOG.debug("no answer of the ROS master: %s", error)
            if self._closing.wait(self._period):
                return

    def _is_new_master(self) -> bool:
        """Return whether the master has another run id (roscore sets it), or does not know this node."""
        master = rosgraph.Master(rospy.get_name())
        known_run = self._run_id
        self._run_id = str(master.getParam("/run_id")) if master.hasParam("/run_id") else ""
        if known_run and self._run_id != known_run:
            return True
        try:
            master.lookupNode(rospy.get_name())
        except rosgraph.MasterError:
            return True
        return False


def register_all() -> None:
    """Register everything that this process publishes, subscribes to and serves, as if it were new."""
    listeners = registration.get_registration_listeners()
    topics, services = registration.get_topic_manager(), registration.get_service_manager()
    kinds = registration.Registration
    for name, data_type in topics.get_publications():
        listeners.notify_added(name, data_type, kinds.PUB)
    for name, data_type in topics.get_subscriptions():
        listeners.notify_added(name, data_type, kinds.SUB)
    for name, uri in services.get_services():
        listeners.notify_added(name, uri, kinds.SRV)
