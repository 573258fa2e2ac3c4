"""The command: port, address, end."""

import os
import signal
import socket
import time
from pathlib import Path

import pytest
from conftest import MODEL
from served_page import Page, serve

from soilml.cli import main


def test_a_port_in_use_is_one_line(capsys):
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        assert main(["serve", "--no-browser", "--port", str(port)]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert f"port {port} of 127.0.0.1 cannot be opened" in said and "--port N" in said


def at_work(folder):
    """A server whose worker has begun an analysis."""
    process = serve("--port", "0", env={"TMPDIR": str(folder)})
    page = Page(process)
    key = page.put("RUNS.csv", b"run,slip,load_N,torque_Nm\na,0.3,60,2.26\n")
    job, _ = page.ask("/api/jobs", {"kind": "gap", "files": [key], "model": MODEL})
    assert job["state"] == "running"
    return process


@pytest.mark.slow
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
def test_a_signal_ends_it_in_one_line_and_removes_its_files(name, tmp_path):
    process = at_work(tmp_path)
    assert list(tmp_path.iterdir())
    process.send_signal(getattr(signal, name))
    _, said = process.communicate(timeout=60)
    assert process.returncode == 128 + getattr(signal, name)
    assert said == "soilml: the page is closed, and what was dropped on it is removed\n"
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_a_worker_ends_with_its_server(tmp_path):
    """Even where the server is killed: the worker sees the end of its input."""
    process = at_work(tmp_path)
    wait_for(lambda: bool(_workers_below(tmp_path)))
    process.kill()
    process.communicate(timeout=60)
    wait_for(lambda: not _workers_below(tmp_path))


def wait_for(condition):
    until = time.monotonic() + 60.0
    while not condition():
        assert time.monotonic() < until
        time.sleep(0.1)


def _workers_below(folder):
    """Processes whose arguments name the folder."""
    proc = Path("/proc")
    if not proc.exists():
        pytest.skip("needs /proc")
    found = []
    for entry in proc.iterdir():
        if entry.name.isdigit() and int(entry.name) != os.getpid():
            try:
                words = (entry / "cmdline").read_bytes()
            except OSError:
                continue
            if str(folder).encode() in words and b"soilml.serve.worker" in words:
                found.append(entry.name)
    return found
