"""The watch over the ROS master: after its restart the node is registered again, because a new master knows no nodes.

The registration is rospy's own; existing connections are left as they are. A master that is gone is told of, for no new
call finds the driver until it is back.
"""
import logging
import threading
from typing import Callable, Sequence

import rosgraph
import rospy
from rospy.impl import registration

_LOG = logging.getLogger(__name__)

_PERIOD_S = 1.0
"""Period, s, of the questions: so long at most does a restarted master know nothing of this node."""
_UNANSWERED = 3
"""Questions without an answer after which it is told: one may be lost on a busy computer."""
_LAST = "/get_loggers"
"""A service of every rospy node, registered after all others: a master that has it, has all.

That the master knows the node's name says less. It learns the name from any question for a parameter.
"""


class MasterWatch:
    """The poller of the master that registers all publishers, subscribers and services again after its restart."""

    def __init__(self, on_new_master: Callable[[], None], offers: Sequence[Callable[[], None]] = (),
                 period: float = _PERIOD_S) -> None:
        """Set up the poller; ``start`` begins.

        Args:
            on_new_master: Called after the registration, to set parameters again: a new master has lost them, too.
            offers: Called each time that the master has answered; they offer what can be offered by then, and wait for
                the master as the watch does.
            period: Of the polling, s.
        """
        self._on_new_master = on_new_master
        self._offers = offers
        self._period = period
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="master watch", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def close(self) -> None:
        """Stop polling; a running call to the master is not waited for."""
        self._closing.set()

    def _run(self) -> None:
        unanswered = 0
        while True:
            try:
                if not is_registered(rosgraph.Master(rospy.get_name())):
                    _LOG.warning("the ROS master was restarted; registering with the new one")
                    register_all()
                    self._on_new_master()
                elif unanswered >= _UNANSWERED:
                    _LOG.warning("the ROS master answers again")
                unanswered = 0
            except Exception as error:  # none, one that is cut off, or of another process at its address
                unanswered += 1
                if unanswered == _UNANSWERED:
                    _LOG.warning("the ROS master does not answer: no new call finds this driver, ~stop_move neither; "
                                 "the emergency stop is what is left (%s: %s)", type(error).__name__, error)
            if not unanswered:
                self._offer()
            if self._closing.wait(self._period):
                return

    def _offer(self) -> None:
        for offer in self._offers:
            try:
                offer()
            except Exception:  # the master is gone just now, or a defect: neither ends the watch
                if not self._closing.is_set():
                    _LOG.exception("a topic or service cannot be offered")


def is_registered(master: rosgraph.Master) -> bool:
    """Return whether the master knows what this process offers; raises OSError where it does not answer."""
    try:
        return bool(master.lookupService(rospy.get_name() + _LAST))
    except rosgraph.MasterError:
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
    for name, uri in sorted(services.get_services(), key=lambda service: service[0] == rospy.get_name() + _LAST):
        listeners.notify_added(name, uri, kinds.SRV)
