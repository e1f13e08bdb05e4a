"""The timely waking of one thread."""
import contextlib
import ctypes
import gc
import os
import platform
import struct
import sys
from typing import Iterator

_PR_SET_TIMERSLACK = 29
_PR_GET_TIMERSLACK = 30
"""Option of prctl(2) for the timer slack: the kernel's delay, ns, in waking this thread; 50 us unless set."""
_SCHED_SETATTR = {"x86_64": 314, "aarch64": 274}
_SCHED_ATTR = struct.Struct("=IIQiIQQQ")
"""Fields of sched_setattr(2): size, policy, flags, nice, priority, runtime, deadline, period."""
_SLICE_NS = 100000
"""Time slice asked for, the shortest there is (Linux 6.12 and newer): a waking thread with a short slice goes first."""
_SWITCH_INTERVAL_S = 0.0002
"""Longest time, s, that a Python thread keeps the others waiting: 5 ms unless set, which every message would show."""


def _ask_for_slice(libc: ctypes.CDLL, slice_ns: int) -> None:
    """Set the calling thread's time slice under the normal policy; 0: the system's own. Older systems ignore it."""
    number = _SCHED_SETATTR.get(platform.machine())
    if number is not None and os.sched_getscheduler(0) == os.SCHED_OTHER:
        nice = os.getpriority(os.PRIO_PROCESS, 0)
        libc.syscall(number, 0, _SCHED_ATTR.pack(_SCHED_ATTR.size, os.SCHED_OTHER, 0, nice, 0, slice_ns, 0, 0), 0)


@contextlib.contextmanager
def precise_wakeups() -> Iterator[None]:
    """Make the calling thread wake within microseconds of its timers, where the system lets it.

    Within it the thread goes before others of its priority, is not held up by garbage collection, and gets the
    interpreter back from other threads quickly.
    """
    libc = ctypes.CDLL(None, use_errno=True)
    slack = libc.prctl(_PR_GET_TIMERSLACK, 0, 0, 0, 0)
    libc.prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0)
    _ask_for_slice(libc, _SLICE_NS)
    interval = sys.getswitchinterval()
    sys.setswitchinterval(_SWITCH_INTERVAL_S)
    was_collecting = gc.isenabled()
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        yield
    finally:
        if was_collecting:
            gc.enable()
        gc.unfreeze()
        sys.setswitchinterval(interval)
        _ask_for_slice(libc, 0)
        if slack > 0:
            libc.prctl(_PR_SET_TIMERSLACK, slack, 0, 0, 0)
