"""The base class of all handlers: who is answered, headers of every answer, errors in one line."""

from __future__ import annotations

import json
from typing import Any

from tornado.web import HTTPError, RequestHandler

from soilml.errors import SoilmlError
from soilml.report.page import finite_or_null

#: What the page may load: its own files alone, no inline script or style, no other host.
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
    "connect-src 'self'; frame-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'"
)
HEADERS = {
    "Content-Security-Policy": POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}
_READING = ("GET", "HEAD")  # Methods that only read
#: What is said with a status that the server's library answers; others below 500 have the first.
_REFUSALS = {
    400: "the request is malformed",
    403: "this is no file of the page",
    404: "there is no such page",
    405: "this address takes no such request",
}


class RefusedError(HTTPError):
    """A request that is answered with a status and one line."""

    def __init__(self, status: int, text: str) -> None:
        super().__init__(status, text.replace("%", "%%"))
        self.text = text


class GuardedHandler(RequestHandler):
    """Answers requests of the page itself, and refuses all others before they are read.

    A page of another site can make a browser send requests to this machine, and a name that leads
    to 127.0.0.1 can make its own page the server's; hence the checks of Host, Origin and
    Sec-Fetch-Site. A body must be declared as one that no form of another site can send.
    """

    def set_default_headers(self) -> None:
        """The headers of every answer."""
        for name, value in HEADERS.items():
            self.set_header(name, value)
        self.clear_header("Server")

    def prepare(self) -> None:
        """Refuse what the page did not send."""
        headers = self.request.headers
        hosts: tuple[str, ...] = self.settings["hosts"]
        if len(headers.get_list("Host")) != 1 or headers["Host"] not in hosts:
            raise RefusedError(403, f"this server answers as {hosts[0]} alone")
        origin = headers.get("Origin")
        if origin is not None and origin != f"http://{headers['Host']}":
            raise RefusedError(403, "requests of other sites are refused")
        if headers.get("Sec-Fetch-Site", "none") not in ("same-origin", "none"):
            raise RefusedError(
                403, "requests of other sites are refused: type the address yourself"
            )
        kind = headers.get("Content-Type", "").partition(";")[0]
        if self.request.method not in _READING and kind not in (
            "application/json",
            "application/octet-stream",
        ):
            raise RefusedError(415, "a body must be application/json or application/octet-stream")

    def content(self) -> dict[str, Any]:
        """The request's body, a JSON object."""
        try:
            found = json.loads(self.request.body, parse_int=float)
            json.dumps(found, ensure_ascii=False).encode()  # texts that can be written to a file
        except (ValueError, RecursionError):
            found = None
        if not isinstance(found, dict):
            raise RefusedError(400, "the request is no JSON object")
        return found

    def answer(self, content: Any) -> None:
        """Write JSON; numbers that are not finite become null."""
        self.set_header("Content-Type", "application/json; charset=utf-8")
        self.finish(json.dumps(finite_or_null(content), allow_nan=False, separators=(",", ":")))

    def write_error(self, status_code: int, **options: Any) -> None:
        """One line, as JSON; what went wrong inside is not shown."""
        error = options.get("exc_info", (None, None, None))[1]
        if isinstance(error, SoilmlError):
            status_code = 422
            text = " ".join(str(error).split())
        elif isinstance(error, RefusedError):
            text = error.text
        elif status_code < 500:
            text = _REFUSALS.get(status_code, _REFUSALS[400])
        else:
            text = "the server failed; see where it was started"
        self.set_status(status_code)
        self.answer({"error": text})

    def log_exception(self, typ: Any, value: Any, tb: Any) -> None:
        """Report what is not refused on purpose."""
        if not isinstance(value, SoilmlError | HTTPError):
            super().log_exception(typ, value, tb)
