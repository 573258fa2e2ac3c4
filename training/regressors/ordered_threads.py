"""Work on parts of an array in threads, with results in order: linear algebra releases the GIL."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from itertools import islice
from typing import TypeVar

from threadpoolctl import threadpool_limits

from soilml.processes import usable_cores

Item = TypeVar("Item")
Result = TypeVar("Result")
Progress = Callable[[int, int], None]  # Called with the steps done and the total number of steps


def thread_count() -> int:
    """Threads that `ordered_map` uses."""
    return usable_cores()


def ordered_map(function: Callable[[Item], Result], items: Iterable[Item]) -> Iterator[Result]:
    """Results of a function of each item, in order, in one thread for each usable core.

    Each call uses one thread of linear algebra. No more results wait than there are threads, which
    bounds their memory.
    """
    threads = thread_count()
    with threadpool_limits(1):
        if threads == 1:
            yield from map(function, items)
            return
        rest = iter(items)
        with ThreadPoolExecutor(threads) as pool:
            pending: deque[Future[Result]] = deque(
                pool.submit(function, item) for item in islice(rest, threads + 1)
            )
            while pending:
                result = pending.popleft().result()
                pending.extend(pool.submit(function, item) for item in islice(rest, 1))
                yield result
