"""Work that takes long: each job in a process of its own, which can be ended at any time."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import re
import secrets
import shutil
import signal
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from soilml.errors import InputError
from soilml.serve.job_commands import COMMAND, LOOKED, READ, WRITTEN

_MOST_JOBS = 24  # Jobs that are remembered; the oldest are forgotten with their files
#: What commands write to standard error: progress in per cent, remarks, and what they refuse.
_SHARE = re.compile(r"(.*): (\d+) %(.*)")
_REMARK = "! "
_PROGRAM = re.compile(r"^soilml[\w -]*: ")
_REFUSED, _ANSWERED = 2, (0, 3)  # Exit status of a command; 3: data that cannot be analysed
_CRASHED = "the analysis ended without an answer: the machine may have too little memory"


@dataclass
class Job:
    """A request, its process, and what it has said so far."""

    key: str
    kind: str
    folder: Path
    state: str = "running"  # done, failed, cancelled
    command: str = ""
    remarks: list[str] = field(default_factory=list)
    stage: str = "starting"
    share: float | None = None
    result: Any = None
    error: str = ""
    process: asyncio.subprocess.Process | None = None
    task: asyncio.Task[None] | None = field(default=None, repr=False)

    def take(self, line: str) -> None:
        """Take a line of the command: what it is, a remark, or its present stage."""
        if line.startswith(COMMAND):
            self.command = line[len(COMMAND) :]
            self.stage = " ".join([*self.command.split()[:2], "..."])
        elif line.startswith(_REMARK):
            self.remarks.append(line[len(_REMARK) :])
        else:
            found = _SHARE.fullmatch(line)
            self.share = None if found is None else int(found[2]) / 100.0
            self.stage = line if found is None else f"{found[1]}{found[3]}"

    def end(self, status: int, last: str) -> None:
        """Take the exit status of the command, and its last line, by which it refuses."""
        if status not in _ANSWERED:
            self.state, self.error = "failed", last if status == _REFUSED else _CRASHED
            return
        files = {path.name: path for path in (self.folder / WRITTEN).iterdir() if path.is_file()}
        self.state = "done"
        self.result = {"command": self.command, "files": sorted(files), "remarks": self.remarks}
        if self.kind == "look":
            self.result = json.loads(files[Path(LOOKED).name].read_text(encoding="utf-8"))

    def as_json(self) -> dict[str, Any]:
        """What the page asks for again and again."""
        said: dict[str, Any] = {"id": self.key, "state": self.state, "stage": self.stage}
        return said | {"share": self.share, "result": self.result, "error": self.error}

    def written(self, name: str) -> Path:
        """A file that the job has written and listed; `InputError` where there is none."""
        if name not in (self.result or {}).get("files", []):
            raise InputError(f"this analysis has no file {name}")
        return self.folder / WRITTEN / name


class Jobs:
    """The jobs of the page; a new one of a kind ends the one before it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._jobs: dict[str, Job] = {}

    async def start(self, kind: str, request: dict[str, Any], files: list[Path]) -> Job:
        """Start a process on copies (hard links) of the files in a folder of its own."""
        for other in self._jobs.values():
            if other.kind == kind and other.state == "running":
                await self.cancel(other)
        while len(self._jobs) >= _MOST_JOBS:
            await self.forget(next(iter(self._jobs.values())))
        key = secrets.token_hex(16)
        job = Job(key, kind, self.folder / key)
        for name in (READ, WRITTEN):
            (job.folder / name).mkdir(parents=True)
        for file in files:
            target = job.folder / READ / file.name
            if target.exists():
                raise InputError(f"two files have the name {file.name}; rename one of them")
            try:
                os.link(file, target)
            except OSError:  # a file system without hard links
                shutil.copyfile(file, target)
        self._jobs[key] = job
        job.task = asyncio.create_task(self._follow(job, {"kind": kind, **request}))
        return job

    def find(self, key: str) -> Job:
        """The job of a key; `InputError` where there is none."""
        if key not in self._jobs:
            raise InputError("this analysis is gone: the server was restarted; start it again")
        return self._jobs[key]

    async def cancel(self, job: Job) -> None:
        """End the process of a job that is running."""
        if job.state == "running":
            job.state = "cancelled"
        if job.process is not None:
            _kill(job.process)
        if job.task is not None:
            await job.task

    async def forget(self, job: Job) -> None:
        """End a job and remove its files."""
        await self.cancel(job)
        self._jobs.pop(job.key, None)
        shutil.rmtree(job.folder, ignore_errors=True)

    async def close(self) -> None:
        """End all jobs."""
        for job in list(self._jobs.values()):
            await self.cancel(job)

    async def _follow(self, job: Job, request: dict[str, Any]) -> None:
        """Start the process, and take what it says until it ends."""
        command = [sys.executable, "-m", "soilml.serve.worker", str(job.folder / READ)]
        process = await asyncio.create_subprocess_exec(
            *command,
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.DEVNULL,
            stderr=asyncio.subprocess.PIPE,
            limit=1 << 20,  # bytes of a line
            start_new_session=True,  # Ctrl-C is for the server, which ends its workers
        )
        job.process = process
        if job.state != "running":  # cancelled while it started
            _kill(process)
        assert process.stdin is not None and process.stderr is not None
        with contextlib.suppress(OSError):  # it has ended already
            process.stdin.write(json.dumps(request).encode() + b"\n")
            await process.stdin.drain()
        last = ""
        while line := await process.stderr.readline():
            last = line.decode(errors="replace").rstrip("\n")
            job.take(last)
        # the pipe stays open until here: a worker ends when the server does
        process.stdin.close()
        status = await process.wait()
        if job.state == "running":
            job.end(status, _PROGRAM.sub("", last))


def _kill(process: asyncio.subprocess.Process) -> None:
    """End a process; its own `kill` would take the exit status from the event loop."""
    if process.returncode is None:
        with contextlib.suppress(ProcessLookupError):
            os.kill(process.pid, getattr(signal, "SIGKILL", signal.SIGTERM))
