"""`soilml serve`: a live page in the browser."""

from __future__ import annotations

import argparse

HELP = "open a live page: forward model, logs, estimates, gaps"
DESCRIPTION = """\
Serve a page on this machine alone (http://127.0.0.1:8642/) and open it in the
browser: the forward model with sliders, the import of logs, estimates of the
soil, drawbar pull, the gap between model and measurements. Ctrl-C ends it, and
what was dropped on the page is removed then.

  soilml serve
  soilml serve --port 9000 --no-browser
"""
#: Where the page is served unless --port says otherwise.
PORT = 8642


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        "--port",
        type=int,
        default=PORT,
        metavar="N",
        help=f"port of the page (default: {PORT}; 0 takes a free one)",
    )
    parser.add_argument(
        "--no-browser", action="store_true", help="print the address, and open no browser"
    )


def run(args: argparse.Namespace) -> int:
    """Serve until a signal ends the process."""
    from soilml.serve.execution import run

    return run(args)
