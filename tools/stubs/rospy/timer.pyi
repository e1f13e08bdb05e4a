import threading
from typing import Any, Callable

from .rostime import Duration

class Timer(threading.Thread):
    # The event is a rospy.timer.TimerEvent.
    def __init__(
        self, period: Duration, callback: Callable[[Any], Any], oneshot: bool = False, reset: bool = False
    ) -> None: ...
    def shutdown(self) -> None: ...
