"""The watch at a running graph: a process that prints what it sees of the arms, a line of JSON each.

Its argument is JSON, the namespaces of the arms. Lines that it prints, times in s of the monotonic clock:

- ``{"event": "ready"}``: the drivers are there, and the graph is watched.
- ``{"event": "seen", "kind", "arm", "what", "nth", "monotonic_s"}``: a cause, counted since a line ``begin`` on stdin.
- ``{"event": "call", "service", "is_repeated", "monotonic_s"}``: a service has answered.
- ``{"event": "rest", "arm", "monotonic_s"}``: the arm has come to rest.
"""
import json
import signal
import sys
import threading
import time
from typing import Any, Callable, List, Optional

import rospy
from roslib import message as roslib_message

from jaka_bag.errors import BagError
from jaka_bag.interrupts import Flag

from ..attended import ReplayStopped
from ..driver_client import DriverClient
from ..scenario import BANKS, IO_TOPIC
from .sightings import Polls, Sighting, Sightings, terminals_in

_WAIT_S = 60.0
"""Longest wait, s, for a driver and its first joints: a launch with several drivers on a busy host."""
_SETTLE_S = 0.5
"""Time, s, for latched topics to come, of which nothing says that they will."""


class _Arm:
    """The watch of one arm; its methods are called by rospy's threads."""

    def __init__(self, namespace: str, say: Callable[..., None]) -> None:
        self._namespace = namespace
        self._say = say
        self._lock = threading.Lock()
        self._seen = Sightings(namespace)
        self._polls = Polls()
        self._is_counting = False
        self._was_moving = False
        node = namespace + "/jaka_driver"
        for name, kind, take in ((IO_TOPIC, "jaka_msgs/IOStates", self._terminals),
                                 ("joint_position", "sensor_msgs/JointState", self._joints),
                                 ("service_calls", "jaka_msgs/ServiceCall", self._answered)):
            known = roslib_message.get_message_class(kind)
            if known is None:
                raise BagError("the message type %s is not installed" % kind)
            rospy.Subscriber("%s/%s" % (node, name), known, take, queue_size=1000, tcp_nodelay=True)

    def begin(self) -> None:
        """Count what is seen from now on."""
        with self._lock:
            self._seen = Sightings(self._namespace, self._seen.levels)
            self._is_counting = True

    def _tell(self, sightings: List[Sighting]) -> None:
        for cause, at in sightings if self._is_counting else ():
            self._say(event="seen", kind=cause.kind.value, arm=cause.arm, what=cause.what, nth=cause.nth,
                      monotonic_s=at)

    def _terminals(self, message: Any) -> None:
        levels = terminals_in({bank: {name: getattr(getattr(message, bank), name)
                                      for name in ("digital_inputs", "digital_outputs")} for bank in BANKS})
        with self._lock:
            self._tell(self._seen.terminals(levels, time.monotonic()))

    def _joints(self, message: Any) -> None:
        now = time.monotonic()
        with self._lock:
            self._tell(self._seen.joints(message.position, now))
            moves = self._seen.is_moving
            if self._is_counting and self._was_moving and not moves:
                self._say(event="rest", arm=self._namespace, monotonic_s=now)
            self._was_moving = moves

    def _answered(self, message: Any) -> None:
        now = time.monotonic()
        with self._lock:
            self._tell(self._seen.answered(message.service.rpartition("/jaka_driver/")[2], now))
            if self._is_counting:
                repeated = self._polls.is_repeated(message.service, message.request, message.response)
                self._say(event="call", service=message.service, is_repeated=repeated, monotonic_s=now)


def main(argv: Optional[List[str]] = None) -> int:
    """Watch until stdin ends or a signal comes; return 1 where a driver is not there."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    namespaces: List[str] = json.loads((sys.argv[1:] if argv is None else argv)[0])
    printing = threading.Lock()

    def say(**line: Any) -> None:
        with printing:
            print(json.dumps(line), flush=True)

    client = DriverClient("jaka_cell_watch", Flag())
    try:
        for namespace in namespaces:
            client.wait_for([namespace + "/jaka_driver/stop_move"], _WAIT_S)
            client.joint_position(namespace + "/jaka_driver/joint_position", _WAIT_S)
        arms = [_Arm(namespace, say) for namespace in namespaces]
    except (BagError, ReplayStopped) as error:
        print("error: %s" % error, file=sys.stderr)
        return 1
    time.sleep(_SETTLE_S)  # the latched topics have come
    say(event="ready")
    for line in sys.stdin:
        if line.strip() == "begin":
            for arm in arms:
                arm.begin()
    return 0


if __name__ == "__main__":
    sys.exit(main())
