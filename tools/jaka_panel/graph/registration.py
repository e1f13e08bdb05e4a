"""The node's registration at the ROS master, made anew after a restart: a new master knows no nodes.

Connections that exist go on without it, but a driver drops a publisher that the new master does not know.
"""
import logging

import rosgraph
import rospy
from rospy.impl import registration

_LOG = logging.getLogger(__name__)


_LAST = "/get_loggers"
"""A service of every rospy node, registered after all others: a master that has it, has all.

That the master knows the node's name says less: any new subscription of this node tells it.
"""


def register_again_at_a_new_master(master: rosgraph.Master) -> None:
    """Register all that this process publishes, subscribes to and serves, where the master was started anew.

    Raises OSError where the master does not answer.
    """
    last = rospy.get_name() + _LAST
    try:
        master.lookupService(last)
        return
    except rosgraph.MasterError:
        _LOG.warning("the ROS master was restarted: this node registers again")
    listeners, kinds = registration.get_registration_listeners(), registration.Registration
    topics, services = registration.get_topic_manager(), registration.get_service_manager()
    for kind, registered in (
            (kinds.PUB, topics.get_publications()), (kinds.SUB, topics.get_subscriptions()),
            (kinds.SRV, sorted(services.get_services(), key=lambda service: service[0] == last))):
        for name, value in registered:
            listeners.notify_added(name, value, kind)
