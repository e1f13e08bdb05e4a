"""Programs that keep a controller's time do so on a busy host, too."""
import os
import sys

_SWITCH_INTERVAL_S = 0.0005
_PRIORITY = 10
_NICENESS = -10


def raise_priority(realtime: bool) -> None:
    """Be woken in time; where that is not allowed, only an explicit wish is worth a word.

    Args:
        realtime: Real-time priority instead of a niceness of -10.
    """
    sys.setswitchinterval(_SWITCH_INTERVAL_S)
    try:
        if realtime:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(_PRIORITY))
        else:
            os.setpriority(os.PRIO_PROCESS, 0, _NICENESS)
    except OSError as error:
        if realtime:
            print("jaka_sim: warning: no real-time priority: %s" % error, file=sys.stderr)
