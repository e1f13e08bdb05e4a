"""Work that may take long, and that somebody may want to end: it is done in a thread, and left alone then."""
import threading
from typing import Any, Callable, List, Optional, Tuple, TypeVar

from jaka_bag.errors import BagError

_POLL_S = 0.02
"""Longest wait, s, before the next look whether the replay was stopped: the delay of Ctrl-C."""

T = TypeVar("T")


class ReplayStopped(BagError):
    """The end of a replay before all was done; the text says why. What it had asked for may still run."""


def attended(work: Callable[[], T], why_end: Callable[[], Optional[str]]) -> T:
    """Run ``work`` in a thread; return its value, raise its errors.

    A signal's handler may not wait, and a call of a service does not end before its motion has: so the caller's thread
    looks 50 times a second whether to go on, and leaves the work to itself where not.

    Args:
        work: Done in a thread of its own.
        why_end: Why not to wait any longer; None to wait.

    Raises:
        ReplayStopped: There was a reason not to wait any longer; it is the error's text.
    """
    found: List[Tuple[Any, Optional[BaseException]]] = []

    def do() -> None:
        try:
            found.append((work(), None))
        except BaseException as error:
            found.append((None, error))

    thread = threading.Thread(target=do, name="work", daemon=True)
    thread.start()
    while thread.is_alive():
        thread.join(_POLL_S)
        reason = why_end()
        if reason is not None:
            raise ReplayStopped(reason)
    value, error = found[0]
    if error is not None:
        raise error
    result: T = value
    return result
