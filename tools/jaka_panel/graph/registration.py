"""The node's registration at the ROS master, made anew after a restart: a new master knows no nodes.

Connections that exist go on without it, but a driver drops a publisher that the new master does not know.
"""
import logging

import rosgraph
import rospy
from rospy.impl import registration

_LOG = logging.getLogger(__name__)


class NodeRegistration:
    """The registration of all that this process publishes, subscribes to and serves."""

    def __init__(self) -> None:
        self._run_id = ""

    def renew(self, master: rosgraph.Master) -> None:
        """Register again where the master was started anew; raises OSError or MasterException where it is silent."""
        before, self._run_id = self._run_id, str(master.getParam("/run_id")) if master.hasParam("/run_id") else ""
        try:
            master.lookupNode(rospy.get_name())
            if not before or before == self._run_id:
                return
        except rosgraph.MasterError:
            pass  # it does not know this node
        _LOG.warning("the ROS master was restarted: this node registers again")
        listeners, kinds = registration.get_registration_listeners(), registration.Registration
        topics, services = registration.get_topic_manager(), registration.get_service_manager()
        for kind, registered in ((kinds.PUB, topics.get_publications()), (kinds.SUB, topics.get_subscriptions()),
                                 (kinds.SRV, services.get_services())):
            for name, value in registered:
                listeners.notify_added(name, value, kind)
