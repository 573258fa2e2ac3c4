"""`soilml serve`: a live page in the browser."""

from __future__ import annotations

import argparse
import contextlib
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from soilml.cli.option_values import whole_number_from
from soilml.errors import InputError

if TYPE_CHECKING:
    import socket

DESCRIPTION = """\
Serve a page on this machine alone (http://127.0.0.1:8642/) and open it in the
browser: the forward model with sliders, the import of logs, estimates of the
soil, drawbar pull, the gap between model and measurements. Ctrl-C ends it, and
what was dropped on the page is removed then.

  soilml serve
  soilml serve --port 9000 --no-browser
"""
HOST = "127.0.0.1"  # The page is for this machine alone
#: What needs a library, and the extra that brings it.
_LIBRARIES = ((("tornado", "serve"), ("scipy", "ground"), ("jinja2", "ground"),
               ("matplotlib", "ground"), ("pint", "ground")))  # fmt: skip
#: Seconds after which a connection is closed: one without requests, and one whose body stalls.
_SECONDS = {"idle_connection_timeout": 3600.0, "body_timeout": 120.0}
PORT = 8642  # Where the page is served unless --port says otherwise
ARGUMENTS = (
    (f"--port N ({PORT})", "port of the page; 0 takes a free one", whole_number_from(0, 65535)),
    ("--no-browser", "print the address, and open no browser"),
)


def run(args: argparse.Namespace) -> int:
    """Serve until a signal ends the process; the exit status is 128 and its number."""
    import asyncio
    import tempfile

    from soilml.optional_imports import need

    for library, extra in _LIBRARIES:
        need(library, "serve", extra)
    opened = _listen(args.port)
    with tempfile.TemporaryDirectory(prefix="soilml-serve-") as folder:
        number = asyncio.run(_serve(opened, Path(folder), browser=not args.no_browser))
    with contextlib.suppress(OSError):  # a terminal that is closed
        print("soilml: the page is closed, and what was dropped on it is removed", file=sys.stderr)
    return 128 + number


def _listen(port: int) -> socket.socket:
    """A listening socket on the loopback interface; `InputError` where the port is in use."""
    import socket

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
    import asyncio
    import signal
    import webbrowser

    from tornado.httpserver import HTTPServer

    from soilml.serve.application import LARGEST_BODY, application

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
    server = HTTPServer(app, max_body_size=LARGEST_BODY, **_SECONDS)
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
