"""The store of dropped files: what it holds, and what it has promised to hold."""

import socket
import time
from contextlib import ExitStack

import pytest
from served_page import page as page

from soilml.errors import InputError
from soilml.serve.uploads import LARGEST_FILE, LARGEST_SUM, STALLED_AFTER, Uploads

COUNT = LARGEST_SUM // LARGEST_FILE


def test_the_page_takes_no_more_at_a_time_than_in_all(page):
    def answer(opened):
        """What is said to the head of a large file, before its content is sent."""
        opened.sendall(
            f"PUT /api/files?name=a.csv HTTP/1.1\r\nHost: 127.0.0.1:{page.port}\r\n"
            "Content-Type: application/octet-stream\r\nExpect: 100-continue\r\n"
            f"Content-Length: {LARGEST_FILE}\r\n\r\n".encode()
        )
        return opened.recv(12)

    def connection():
        return socket.create_connection(("127.0.0.1", page.port), timeout=30)

    with ExitStack() as stack:
        for _ in range(COUNT):
            assert answer(stack.enter_context(connection())) == b"HTTP/1.1 100"
        assert answer(stack.enter_context(connection())) == b"HTTP/1.1 413"
    until = time.monotonic() + 30.0  # files that were begun and left make room again
    while True:
        with connection() as opened:
            if answer(opened) == b"HTTP/1.1 100":
                break
        assert time.monotonic() < until
        time.sleep(0.05)


def test_uploads_that_have_stalled_make_room(tmp_path):
    now = [0.0]
    uploads = Uploads(tmp_path, clock=lambda: now[0])
    stalled, alive, *_ = [uploads.place("a.csv", LARGEST_FILE) for _ in range(COUNT)]
    now[0] = STALLED_AFTER + 1.0
    assert uploads.has_come_on(alive)
    kept = uploads.place("b.csv", LARGEST_FILE)
    assert not stalled.path.parent.exists() and not uploads.has_come_on(stalled)
    assert uploads.has_come_on(alive) and uploads.has_come_on(kept)
    uploads.place("c.csv", LARGEST_FILE)
    uploads.place("d.csv", LARGEST_FILE)
    with pytest.raises(InputError, match="1024 MB together"):
        uploads.place("e.csv", LARGEST_FILE)  # none of these has stalled
