"""Requests to the operating system to wake this process's threads in time. Linux only; elsewhere nothing is changed."""
import ctypes
import os
import platform
import struct

_SET_ATTRIBUTES = {"x86_64": 314, "aarch64": 274, "armv7l": 380}
"""The number of the system call sched_setattr, which the C library of Debian 12 does not wrap."""
_SHORTEST_SLICE_NS = 100000
"""The shortest slice that Linux grants, ns: 0.1 ms (sched_attr.sched_runtime)."""
_ATTRIBUTES = struct.Struct("=IIQiIQQQ")  # struct sched_attr: size, policy, flags, nice, priority, runtime, 2 deadlines


def ask_for_short_slices() -> bool:
    """Ask for a short time slice for this thread and those that it starts, so that each runs as soon as it is due.

    From Linux 6.12 on a thread may choose its slice, and one that wakes with a shorter slice goes before one that runs
    with a longer one. The share of the processor stays the same: nobody is starved, and no right is needed. Older
    kernels ignore it.

    Returns:
        False where the system has no such call.
    """
    number = _SET_ATTRIBUTES.get(platform.machine())
    if number is None or not hasattr(os, "sched_getscheduler") or os.sched_getscheduler(0) != os.SCHED_OTHER:
        return False
    attributes = ctypes.create_string_buffer(_ATTRIBUTES.pack(
        _ATTRIBUTES.size, os.SCHED_OTHER, 0, os.getpriority(os.PRIO_PROCESS, 0), 0, _SHORTEST_SLICE_NS, 0, 0))
    return bool(ctypes.CDLL(None).syscall(ctypes.c_long(number), 0, attributes, 0) == 0)


def set_real_time(priority: int) -> None:
    """Give all threads of this process, and those that they start, this priority of SCHED_FIFO.

    All threads need it: a thread with a lower priority that is preempted while it holds the interpreter's lock would
    hold up the one that sends frames.

    Raises:
        OSError: It is not permitted (limit rtprio), or the system has no such policy.
    """
    for thread in os.listdir("/proc/self/task"):
        os.sched_setscheduler(int(thread), os.SCHED_FIFO, os.sched_param(priority))
