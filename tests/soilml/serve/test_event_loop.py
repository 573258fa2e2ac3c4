"""What takes long does not keep the page from others."""

import asyncio
import json
import threading

import pytest

import soilml.serve.application as served
from soilml.errors import InputError

pytest.importorskip("tornado")


def test_the_model_file_of_a_job_is_read_in_another_thread(tmp_path, monkeypatch):
    from tornado.httpclient import AsyncHTTPClient
    from tornado.httpserver import HTTPServer
    from tornado.testing import bind_unused_port

    threads = []

    def model_text(chosen):
        threads.append(threading.current_thread())
        raise InputError("this was read")

    monkeypatch.setattr(served, "model_text", model_text)

    async def ask():
        opened, port = bind_unused_port()
        server = HTTPServer(served.application(tmp_path, port)[0])
        server.add_socket(opened)
        client, address = AsyncHTTPClient(), f"http://127.0.0.1:{port}/api"
        kind = {"Content-Type": "application/octet-stream"}
        sent = await client.fetch(
            f"{address}/files?name=a.csv", method="PUT", body=b"1", headers=kind
        )
        request = {"kind": "estimate", "files": [json.loads(sent.body)["id"]], "model": {}}
        answer = await client.fetch(
            f"{address}/jobs",
            method="POST",
            body=json.dumps(request),
            headers={"Content-Type": "application/json"},
            raise_error=False,
        )
        server.stop()
        return json.loads(answer.body)

    assert asyncio.run(ask())["error"] == "this was read"
    assert threads and threading.main_thread() not in threads
