"""The C library's allocator, for work that needs the same large arrays again and again: it keeps what is freed.

As glibc is set, it gives large blocks back to the system at once, which clears them for the next chunk of a log: a
tenth of a conversion's processor time, and workers side by side hold each other up meanwhile. See mallopt(3).
"""
import ctypes
from typing import NamedTuple


class _Setting(NamedTuple):
    """One parameter of glibc's malloc: its number for mallopt, its value in bytes."""

    number: int
    size: int


_TRIM_THRESHOLD, _MMAP_THRESHOLD, _TOP_PAD = -1, -3, -2
_SETTINGS = (_Setting(_TRIM_THRESHOLD, 128 << 20), _Setting(_MMAP_THRESHOLD, 32 << 20), _Setting(_TOP_PAD, 16 << 20))


def keep_freed_memory() -> None:
    """Have this process keep freed memory for its next allocations; without effect where the C library is another."""
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError):
        return
    for setting in _SETTINGS:
        mallopt(setting.number, setting.size)
