"""The engine `dask`: workers of a cluster, or processes of this machine under a dask scheduler."""

from __future__ import annotations

import logging
import math
import signal
import socket
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cache, lru_cache
from importlib.metadata import version
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeVar

from soilml.errors import InputError, MissingLibraryError
from soilml.processes import prepare_worker, usable_cores

Item = TypeVar("Item")
Result = TypeVar("Result")

#: Seconds to wait for the scheduler, and for a worker to appear again when none is left.
PATIENCE, WORKERLESS = 10, 60
AHEAD = 6  # Tasks that are submitted ahead of the result that is waited for, for each worker
#: Libraries whose versions must be those of this process, because they may change digits.
SAME_VERSIONS = ("numpy", "scipy", "pyarrow")

OWN_EFFECTS = "own_effects_"  # First part of the names of modules that are users' files of effects

#: Tasks of one worker process run one at a time, whatever its number of threads.
_one_at_a_time = threading.Lock()


@contextmanager
def dask_map(
    function: Callable[[Item], Result],
    items: Sequence[Item],
    workers: int | None = None,
    scheduler: str | None = None,
) -> Iterator[Iterator[Result]]:
    """Results of a function of each item, in the order of the items, from workers of dask.

    A task of a worker that dies is done again by another one.

    function: Of the items; picklable, as are the items and the results.
    items: Its arguments.
    workers: Number of local processes where there is no `scheduler`; all usable cores by default.
    scheduler: Address of a running scheduler, such as "tcp://10.0.0.1:8786". None starts one here.

    Raises `MissingLibraryError` where dask is not installed; `InputError` where no scheduler
    answers at the address, it has no worker, a task killed several workers, or a worker has other
    versions of the libraries.
    """
    try:
        from distributed import Client, LocalCluster
    except ImportError:
        raise MissingLibraryError(
            "--engine dask needs dask, which is not installed: pip install '.[cluster]'"
        ) from None
    for name in list(logging.root.manager.loggerDict):
        if name.split(".")[0] == "distributed":  # errors are reported in one line
            logging.getLogger(name).setLevel(logging.CRITICAL)
    count = usable_cores() if workers is None else workers
    with ExitStack() as stack:
        if scheduler is not None:
            _check_address(scheduler)
            address: Any = scheduler
        else:
            with _ignored_by_children(signal.SIGINT):
                cluster = LocalCluster(
                    n_workers=count,
                    threads_per_worker=1,
                    memory_limit=None,
                    dashboard_address="127.0.0.1:0",  # None takes port 8787, or warns
                    silence_logs=logging.CRITICAL,
                )
            address = stack.enter_context(cluster)
        client = stack.enter_context(Client(address, timeout=PATIENCE, set_as_default=False))
        yield _in_order(client, function, items)


@contextmanager
def _ignored_by_children(number: signal.Signals) -> Iterator[None]:
    """Processes that are started inside ignore a signal: this one answers it and ends them.

    A terminal sends Ctrl-C to all processes; a worker would print a traceback of its own.
    """
    if threading.current_thread() is not threading.main_thread():  # handlers are that thread's
        yield
        return
    before = signal.signal(number, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(number, before)


def _in_order(client: Any, function: Callable[[Any], Any], items: Sequence[Any]) -> Iterator[Any]:
    """Results in order; a task is submitted for each that is taken, which bounds their memory."""
    needed, content = own_versions(), _Content.of(function)

    def submit(item: Any) -> Any:
        return client.submit(run_task, content, item, needed, pure=False)

    rest = iter(items)
    pending: deque[Any] = deque()
    looked, ahead = -math.inf, AHEAD
    while True:
        if time.monotonic() > looked + 1.0:  # workers come and go
            looked, ahead = time.monotonic(), AHEAD * max(_workers(client), 1)
        pending.extend(submit(item) for item in islice(rest, max(ahead - len(pending), 0)))
        if not pending:
            return
        yield _result(client, pending.popleft())


def _result(client: Any, future: Any) -> Any:
    """The result of a task; raises `InputError` where there will be none."""
    from concurrent.futures import CancelledError

    from distributed import KilledWorker
    from distributed.comm.core import CommClosedError

    since = time.monotonic()
    while True:
        try:
            return future.result(timeout=1)
        except TimeoutError:
            if _workers(client):
                since = time.monotonic()
            elif time.monotonic() - since > WORKERLESS:
                raise InputError(
                    f"the scheduler has had no worker for {WORKERLESS} s: start some with `dask "
                    "worker ADDRESS`, then repeat the command"
                ) from None
        except KilledWorker:
            raise InputError(
                "several workers died of the same rows, perhaps for want of memory: give each "
                "worker more, then repeat the command"
            ) from None
        except (CancelledError, CommClosedError, ModuleNotFoundError) as error:
            what = (
                f"a worker lacks the package {error.name}: install soilml[ground] there"
                if isinstance(error, ModuleNotFoundError)
                else "the connection to the scheduler was lost: start it and its workers again"
            )
            raise InputError(f"{what}, then repeat the command") from None


def _workers(client: Any) -> int:
    return len(client.scheduler_info(n_workers=-1)["workers"])


@cache
def own_versions() -> dict[str, str]:
    """Versions of the libraries of this process that may change digits."""
    from soilml import __version__

    return {"soilml": __version__} | {name: version(name) for name in SAME_VERSIONS}


@dataclass(frozen=True)
class _Content:
    """A function for other processes, and users' files of effects that it may refer to."""

    function: bytes
    effects: tuple[tuple[str, str], ...]  # name and text of each file

    @classmethod
    def of(cls, function: Callable[[Any], Any]) -> _Content:
        import cloudpickle

        content = cloudpickle.dumps(function)
        files = [
            Path(str(module.__file__))
            for name, module in list(sys.modules.items())
            if name.startswith(OWN_EFFECTS) and name.encode() in content
        ]
        return cls(content, tuple((f.name, f.read_text(encoding="utf-8")) for f in files))


@lru_cache(maxsize=4)
def _function(content: _Content) -> Callable[[Any], Any]:
    """The function of a content, in a worker."""
    import cloudpickle

    from soilml.physics.user_effects import load_effects

    with TemporaryDirectory() as folder:
        for name, text in content.effects:
            file = Path(folder) / name
            file.write_text(text, encoding="utf-8")
            load_effects(file)
    function: Callable[[Any], Any] = cloudpickle.loads(content.function)
    return function


def run_task(content: _Content, item: Any, needed: dict[str, str]) -> Any:
    """Run one task in a worker; `content` is the function.

    Raises `InputError` where the versions of its libraries are not the `needed` ones.
    """
    own = own_versions()
    if own != needed:
        name = next(name for name in needed if own[name] != needed[name])
        raise InputError(
            f"a worker has {name} {own[name]}, this process {needed[name]}: install the same "
            "versions everywhere"
        )
    with _one_at_a_time:
        prepare_worker()
        return _function(content)(item)


def _check_address(scheduler: str) -> None:
    """Raise `InputError` where no scheduler answers at an address; the client waits for long."""
    host, _, port = scheduler.rpartition("://")[2].rpartition(":")
    try:
        with socket.create_connection((host.strip("[]"), int(port)), PATIENCE) as connection:
            if scheduler.startswith("tls") or connection.recv(1):  # a scheduler speaks first
                return
            why = "what answers is something else"
    except (OSError, ValueError, OverflowError) as error:
        why = getattr(error, "strerror", None) or str(error)
    raise InputError(
        f"--scheduler {scheduler}: no dask scheduler answers there ({why}); needed is an address "
        "such as tcp://10.0.0.1:8786. Start one with `dask scheduler`, and workers with `dask "
        "worker ADDRESS --nthreads 1`"
    )
