"""A live page in a process of its own, and requests to it."""

from __future__ import annotations

import http.client
import json
import os
import re
import signal
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from soilml import Operating, soil
from soilml.io.text_tables import csv_text

ROOT = Path(__file__).parents[1]
#: Longest wait for an analysis, s; a machine with other work to do takes its time.
PATIENCE = 240.0


class Page:
    """The address of a served page."""

    def __init__(self, process: subprocess.Popen[str]):
        self.process = process
        said = process.stdout.readline()
        found = re.search(r"http://127\.0\.0\.1:(\d+)/", said)
        assert found, said + process.stderr.read()
        self.port, self.address = int(found[1]), found[0]

    def request(self, method, path, body=None, **headers):
        """Status, headers and body of an answer; `headers` with _ for -, None for none."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=60)
        sent = {"Host": f"127.0.0.1:{self.port}"}
        if body is not None:
            sent["Content-Type"] = "application/json"
        sent |= {name.replace("_", "-"): value for name, value in headers.items()}
        with closing(connection):
            connection.putrequest(method, path, skip_host=True, skip_accept_encoding=True)
            data = json.dumps(body).encode() if isinstance(body, dict) else body
            if data is not None and "Content-Length" not in sent:
                sent["Content-Length"] = str(len(data))
            for name, value in sent.items():
                connection.putheader(name, value)
            connection.endheaders(data)
            with connection.getresponse() as answer:
                return answer.status, answer.headers, answer.read()

    def ask(self, path, body):
        """The JSON of an answer, and its status."""
        status, _, text = self.request("POST", path, body)
        return json.loads(text), status

    def put(self, name, content):
        """The key of a file that is sent."""
        status, _, text = self.request(
            "PUT", f"/api/files?name={name}", content, Content_Type="application/octet-stream"
        )
        assert status == 200, text
        return json.loads(text)["id"]

    def job(self, **request):
        """A job once it has ended."""
        job, status = self.ask("/api/jobs", request)
        assert status == 200, job
        until = time.monotonic() + PATIENCE
        while job["state"] == "running" and time.monotonic() < until:
            time.sleep(0.05)
            job = json.loads(self.request("GET", f"/api/jobs/{job['id']}")[2])
        return job


def serve(*words, env=None):
    """Start the command; the process."""
    return subprocess.Popen(
        [sys.executable, "-m", "soilml", "serve", "--no-browser", *words],
        cwd=ROOT,
        env=os.environ | (env or {}),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.fixture(scope="module")
def page():
    """A served page."""
    process = serve("--port", "0")
    try:
        yield Page(process)
    finally:
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=60)


def runs_file(tmp_path, model, loads=(40.0, 90.0)):
    """Twelve rows in two runs of a wheel on dry sand."""
    slip, load = np.tile(np.linspace(0.1, 0.6, 6), len(loads)), np.repeat(loads, 6)
    force = model(soil("wong1989/dry_sand"), Operating(slip=slip, load=load))
    names = np.repeat([f"run_{i}" for i in range(len(loads))], 6)
    columns = {"run": names, "slip": slip, "load_N": load, "torque_Nm": force.torque}
    columns["sinkage_m"] = force.sinkage
    (tmp_path / "RUNS.csv").write_text(csv_text(columns))
    return tmp_path / "RUNS.csv"
