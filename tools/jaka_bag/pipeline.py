"""Work on many items with several threads, results in order, few in flight."""
from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Callable, Deque, Iterable, Iterator, TypeVar

_Item = TypeVar("_Item")
Result = TypeVar("Result")

WORKERS = 2
"""Threads that decompress, rearrange and compress: each of these lets the others run."""


def in_order(work: Callable[[_Item], Result], items: Iterable[_Item], workers: int = WORKERS) -> Iterator[Result]:
    """Return the result of ``work`` for each item, in the order of the items; its exceptions are raised here.

    Args:
        work: Thread-safe.
        items: Taken one at a time, as threads become free.
        workers: Threads; 1 works in the calling thread.
    """
    if workers <= 1:
        yield from map(work, items)
        return
    with ThreadPoolExecutor(workers) as pool:
        pending: Deque[Future[Result]] = deque()
        try:
            for item in items:
                pending.append(pool.submit(work, item))
                if len(pending) > workers + 1:
                    yield pending.popleft().result()
            while pending:
                yield pending.popleft().result()
        finally:
            for future in pending:
                future.cancel()
