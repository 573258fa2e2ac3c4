"""Serving: the port, the browser, and the end."""

from __future__ import annotations

import argparse
import asyncio
import signal
import socket
import sys
import tempfile
import webbrowser
from pathlib import Path
from typing import Any

from soilml.cli.process import Terminated
from soilml.errors import InputError
from soilml.optional_imports import need

#: The page is for this machine alone.
HOST = "127.0.0.1"
#: What needs a library, and the extra that brings it.
_LIBRARIES = ((("tornado", "serve"), ("scipy", "ground"), ("jinja2", "ground"),
               ("matplotlib", "ground"), ("pint", "ground")))  # fmt: skip


def run(args: argparse.Namespace) -> int:
    """Serve until a signal ends the process; raises `KeyboardInterrupt` or `Terminated` then."""
    for library, extra in _LIBRARIES:
        need(library, "serve", extra)
    if not 0 <= args.port <= 65535:
        raise InputError(f"--port is {args.port}; needed is a number from 0 to 65535")
    opened = _listen(args.port)
    with tempfile.TemporaryDirectory(prefix="soilml-serve-") as folder:
        number = asyncio.run(_serve(opened, Path(folder), browser=not args.no_browser))
    stop: Any = KeyboardInterrupt() if number == signal.SIGINT else Terminated(128 + number)
    stop.said = "the page is closed, and what was dropped on it is removed"
    raise stop


def _listen(port: int) -> socket.socket:
    """A listening socket on the loopback interface; `InputError` where the port is in use."""
    opened = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    if sys.platform != "win32":  # there the option would let two programs share the port
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        opened.bind((HOST, port))
        opened.listen(64)
    except OSError as error:
        opened.close()
        raise InputError(
            f"port {port} of {HOST} cannot be opened ({error.strerror or error}): end the program "
            "that uses it, or give another port with --port N (0 takes a free one)"
        ) from None
    opened.setblocking(False)
    return opened


async def _serve(opened: socket.socket, folder: Path, *, browser: bool) -> int:
    """Serve until a signal comes; its number."""
    from tornado.httpserver import HTTPServer

    from soilml.serve.web.application import LARGEST_BODY, application

    loop = asyncio.get_running_loop()
    stopped: asyncio.Future[int] = loop.create_future()

    def stop(number: int) -> None:
        if not stopped.done():
            stopped.set_result(number)

    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)
        if number is not None:
            try:
                loop.add_signal_handler(number, stop, int(number))
            except NotImplementedError:  # Windows: Ctrl-C raises KeyboardInterrupt as usual
                break
    port = opened.getsockname()[1]
    app, jobs = application(folder, port)
    server = HTTPServer(app, max_body_size=LARGEST_BODY, idle_connection_timeout=3600.0)
    server.add_socket(opened)
    address = f"http://{HOST}:{port}/"
    print(f"soilml serves {address} on this machine alone; Ctrl-C ends it", flush=True)
    if browser:
        loop.run_in_executor(None, webbrowser.open, address)
    try:
        return await stopped
    finally:
        server.stop()
        await jobs.close()
        await server.close_all_connections()
