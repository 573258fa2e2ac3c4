"""An ordered pool of processes of this machine: where rows are simulated unless a cluster is named.

An engine is a function of a function and items that yields an iterator of the results in the order
of the items. Which engine works, and with how many workers, changes no result.
"""

from __future__ import annotations

import ctypes
import multiprocessing
import os
import signal
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures import wait as futures_wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from functools import cache
from itertools import islice
from multiprocessing.connection import wait
from multiprocessing.process import BaseProcess
from typing import Any, TypeVar

from soilml.errors import InputError

Item = TypeVar("Item")
Result = TypeVar("Result")

#: Whether workers have all that this process has; otherwise functions must be picklable.
FORKS = sys.platform == "linux"
ONE_THREAD = 1000  # Readings up to which linear algebra has one thread
AHEAD = 3  # Tasks that are submitted ahead of the result that is waited for, for each worker
GRACE = 2.0  # Seconds without a result after which dead workers are looked for, and are given up
#: Environment variables that limit threads of linear algebra in processes that are spawned.
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
#: Parameters of `mallopt` in the GNU C library, and sizes in bytes.
_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3
KEPT = 64 << 20


#: Most workers that this process starts at a time; None is one for each core.
_most: ContextVar[int | None] = ContextVar("most workers", default=None)


@contextmanager
def process_map(
    function: Callable[[Item], Result],
    items: Sequence[Item],
    workers: int | None = None,
    start_method: str | None = None,
) -> Iterator[Iterator[Result]]:
    """Results of a function of each item, in the order of the items, from several processes.

    Leaving the block, also by an exception, ends all workers; if this process is killed they end
    themselves.

    function: Of the items. Where processes cannot be forked, it must be picklable.
    items: Its arguments, picklable. Results must be, too.
    workers: Number of processes; one for each usable core by default. With 1 the function is called
        here.
    start_method: "fork" or "spawn"; on Linux "fork" by default, which starts in milliseconds.

    Raises `InputError` where a worker was killed.
    """
    count = min(usable_cores() if workers is None else workers, len(items))
    if count <= 1:
        keep_freed_memory()
        with _one_thread():
            yield map(function, items)
        return
    method = start_method or ("fork" if FORKS else "spawn")
    before = set(multiprocessing.active_children())
    limited = {name: os.environ.setdefault(name, "1") for name in THREADS if name not in os.environ}
    pool = ProcessPoolExecutor(
        count, multiprocessing.get_context(method), initializer=_start, initargs=(function,)
    )
    workers_here: list[BaseProcess] = []
    try:
        rest = iter(items)
        first = deque(pool.submit(_call, item) for item in islice(rest, AHEAD * count))
        workers_here += set(multiprocessing.active_children()) - before
        yield _in_order(pool, first, rest, workers_here)
    except BaseException as error:
        _end(pool, workers_here or set(multiprocessing.active_children()) - before)
        if isinstance(error, BrokenProcessPool):
            raise InputError(
                f"one of {count} worker processes was killed, perhaps for want of memory; free "
                "some, or take fewer workers"
            ) from None
        raise
    finally:
        pool.shutdown(cancel_futures=True)
        for name in limited:
            os.environ.pop(name, None)


def _end(pool: ProcessPoolExecutor, workers: Iterable[BaseProcess]) -> None:
    """Kill the workers, and let the pool see it.

    A worker that is killed while it writes leaves part of a result, for whose rest the pool would
    wait for ever: with the pool's own, unused end of the pipe closed, the part is the last.
    """
    for process in workers:
        process.kill()
    results = getattr(pool, "_result_queue", None)
    if results is not None:
        results._writer.close()


def _in_order(
    pool: ProcessPoolExecutor,
    pending: deque[Future[Any]],
    rest: Iterator[Any],
    workers: Sequence[BaseProcess],
) -> Iterator[Any]:
    """Results in order; a task is submitted for each that is taken, which bounds their memory."""
    while pending:
        result = _result(pending.popleft(), workers)
        pending.extend(pool.submit(_call, item) for item in islice(rest, 1))
        yield result


def _result(future: Future[Any], workers: Sequence[BaseProcess]) -> Any:
    """The result of a task; `BrokenProcessPool` where a worker has died and nothing comes.

    The pool itself does not notice a worker that died while it wrote a result.
    """
    while True:
        done, _ = futures_wait([future], timeout=GRACE)
        if done:
            return future.result()
        if not all(process.is_alive() for process in workers):
            done, _ = futures_wait([future], timeout=GRACE)
            if not done:
                raise BrokenProcessPool


_function: Callable[[Any], Any] | None = None  # The function of this worker process


def _start(function: Callable[[Any], Any]) -> None:
    """Prepare a worker: the parent alone answers signals, and the worker ends with it."""
    global _function
    _function = function
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    for name in ("SIGTERM", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_DFL)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    prepare_worker()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)


def _call(item: Any) -> Any:
    assert _function is not None
    return _function(item)


def usable_cores() -> int:
    """Workers that this process may start: its cores, or as many as `limited_workers` allows."""
    if (most := _most.get()) is not None:
        return most
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@contextmanager
def limited_workers(most: int | None) -> Iterator[None]:
    """Inside, engines start at most so many workers; None is one for each core."""
    token = _most.set(most)
    try:
        yield
    finally:
        _most.reset(token)


def prepare_worker() -> None:
    """One thread in this process, and freed memory kept for the next task."""
    _prepare(os.getpid())  # a process that is forked from a prepared one is not prepared itself


@cache
def _prepare(process: int) -> None:
    _most.set(1)  # a task starts no workers of its own
    _one_thread()
    keep_freed_memory()


def _one_thread() -> Any:
    """One thread of linear algebra from here on; a context that ends that."""
    return threads_for(0)


def threads_for(readings: int) -> Any:
    """Threads of linear algebra for a fit of so many readings, until the context ends.

    Matrices of few are so small that several threads only wait for each other.
    """
    from threadpoolctl import threadpool_limits

    return threadpool_limits(1 if readings <= ONE_THREAD else None)


@cache
def keep_freed_memory() -> None:
    """Let the GNU C library keep freed memory of the size of a piece's arrays.

    It would return it to the system, and have it cleared when it asks for it again: that takes
    longer than the arithmetic. Nothing is done elsewhere.
    """
    if sys.platform == "linux":
        with suppress(OSError, AttributeError):
            library = ctypes.CDLL(None)
            library.mallopt(_MMAP_THRESHOLD, KEPT // 2)
            library.mallopt(_TRIM_THRESHOLD, KEPT)
