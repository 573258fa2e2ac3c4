"""The store of dropped files: what it holds, and what it has promised to hold."""

import asyncio
import socket
import time
from contextlib import ExitStack

from served_page import page as page
from tornado.httpserver import HTTPServer

from soilml.serve.application import application
from soilml.serve.uploads import LARGEST_FILE, LARGEST_SUM

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


def test_an_upload_that_stalls_is_closed_and_makes_room(tmp_path):
    async def stalled():
        opened = socket.create_server(("127.0.0.1", 0))
        opened.setblocking(False)
        port = opened.getsockname()[1]
        server = HTTPServer(application(tmp_path, port)[0], body_timeout=0.2)
        server.add_socket(opened)
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(
            f"PUT /api/files?name=a.csv HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n"
            "Content-Type: application/octet-stream\r\nContent-Length: 9\r\n\r\nrun".encode()
        )
        assert await asyncio.wait_for(reader.read(), 20) == b""  # closed without an answer
        writer.close()
        server.stop()
        await server.close_all_connections()

    asyncio.run(stalled())
    assert list((tmp_path / "files").iterdir()) == []
