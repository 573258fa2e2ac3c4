"""The addresses of the page."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, BinaryIO

from tornado.web import Application, StaticFileHandler, stream_request_body

from soilml.errors import InputError
from soilml.serve.forward import choices, controls, forward
from soilml.serve.guarded_handler import GuardedHandler, RefusedError
from soilml.serve.job_commands import KINDS, WITHOUT_FILES
from soilml.serve.jobs import Jobs
from soilml.serve.uploads import LARGEST_FILE, Upload, Uploads

STATIC = Path(__file__).parent / "static"  # The page's own files
#: Largest body of a request that is no file, bytes: a model file and a map with room to spare.
LARGEST_BODY = 2 << 20
_TYPES = {".html": "text/html", ".css": "text/css", ".js": "text/javascript",
          ".svg": "image/svg+xml", ".json": "application/json", ".csv": "text/csv"}  # fmt: skip
#: A report may style itself, which the page may not; it runs no script and loads nothing. The page
#: that shows it in a frame is of the same origin, and measures its height.
REPORT_POLICY = (
    "default-src 'none'; style-src 'unsafe-inline'; img-src data:; frame-ancestors 'self'; "
    "sandbox allow-same-origin"
)


def application(folder: Path, port: int) -> tuple[Application, Jobs]:
    """The application, whose files stand in `folder`, and its jobs."""
    uploads, jobs = Uploads(folder / "files"), Jobs(folder / "jobs")
    # one thread: questions to the model are answered in order, and signals are not delayed
    pool = ThreadPoolExecutor(1)
    routes: list[Any] = [(r"/api/choices", Choices)]
    for name, function in (("controls", controls), ("forward", forward)):
        routes.append((rf"/api/{name}", Question, {"function": function, "pool": pool}))
    routes += [
        (r"/api/files", Files, {"uploads": uploads}),
        (r"/api/jobs", StartJob, {"uploads": uploads, "jobs": jobs}),
        (r"/api/jobs/([0-9a-f]{32})", RunningJob, {"jobs": jobs}),
        (r"/api/jobs/([0-9a-f]{32})/([\w.-]{1,150})", JobFile, {"jobs": jobs}),
        (r"/()", Static, {"path": str(STATIC), "default_filename": "index.html"}),
        (r"/static/([\w/.-]+)", Static, {"path": str(STATIC)}),
    ]
    hosts = (f"127.0.0.1:{port}", f"localhost:{port}")
    settings: dict[str, Any] = {"hosts": hosts, "default_handler_class": NotFound}
    return Application(routes, log_function=lambda handler: None, **settings), jobs


class NotFound(GuardedHandler):
    """Every other address."""

    def prepare(self) -> None:
        """Refuse."""
        super().prepare()
        raise RefusedError(404, "there is no such page")


class Static(GuardedHandler, StaticFileHandler):
    """Files of the page; tornado refuses paths that lead out of their folder."""

    def get_content_type(self) -> str:
        """By the name's ending, whatever the machine's tables say."""
        assert self.absolute_path is not None
        kind = _TYPES.get(Path(self.absolute_path).suffix, "application/octet-stream")
        return f"{kind}; charset=utf-8"

    def set_extra_headers(self, path: str) -> None:
        """The browser asks each time whether a file has changed."""
        self.set_header("Cache-Control", "no-cache")


class Choices(GuardedHandler):
    """Gears and soils to choose from."""

    def get(self) -> None:
        """Answer."""
        self.answer(choices() | {"largest_file": LARGEST_FILE})


class Question(GuardedHandler):
    """A question that is answered at once by a function from a request to an answer."""

    def initialize(
        self, function: Callable[[dict[str, Any]], Any], pool: ThreadPoolExecutor
    ) -> None:
        """Take the function."""
        self.function, self.pool = function, pool

    async def post(self) -> None:
        """Answer, unless the page has asked something newer and left."""
        request = self.content()
        loop = asyncio.get_running_loop()
        found = await loop.run_in_executor(self.pool, self._found, request)
        if not self.left:
            self.answer(found)

    left = False

    def on_connection_close(self) -> None:
        """The page no longer wants the answer."""
        self.left = True

    def _found(self, request: dict[str, Any]) -> Any:
        return None if self.left else self.function(request)


@stream_request_body
class Files(GuardedHandler):
    """Takes a file, piece by piece, into the folder of uploads."""

    def initialize(self, uploads: Uploads) -> None:
        """Take the store."""
        self.uploads = uploads
        self.upload: Upload | None = None
        self.opened: BinaryIO | None = None

    def prepare(self) -> None:
        """Refuse what is too large before it is read."""
        super().prepare()
        length = self.request.headers.get("Content-Length", "")
        if self.request.method != "PUT" or not length.isdecimal():
            raise RefusedError(411, "a file is sent by PUT, with its length")
        try:
            self.upload = self.uploads.place(self.get_query_argument("name", "file"), int(length))
        except InputError as error:
            raise RefusedError(413, str(error)) from None
        connection: Any = self.request.connection
        connection.set_max_body_size(LARGEST_FILE)
        self.opened = self.upload.path.open("wb")

    def data_received(self, chunk: bytes) -> None:
        """Write a piece."""
        assert self.opened is not None
        self.opened.write(chunk)

    def put(self) -> None:
        """All pieces are there."""
        assert self.upload is not None and self.opened is not None
        self.opened.close()
        whole, self.upload = self.upload, None
        self.answer(whole.as_json())

    def on_finish(self) -> None:
        """What was refused after it had a place leaves it."""
        if self.opened is not None:
            self.opened.close()
        if self.upload is not None:
            self.uploads.drop(self.upload)
            self.upload = None

    def on_connection_close(self) -> None:
        """The page left in the middle of it, or took longer than the server waits."""
        self.on_finish()


class StartJob(GuardedHandler):
    """Starts a job."""

    def initialize(self, uploads: Uploads, jobs: Jobs) -> None:
        """Take the stores."""
        self.uploads, self.jobs = uploads, jobs

    async def post(self) -> None:
        """Start it on the files that the request names."""
        request = self.content()
        kind = request.pop("kind", None)
        keys = request.pop("files", None)
        known = isinstance(kind, str) and kind in KINDS
        if not known or not isinstance(keys, list) or not (keys or kind in WITHOUT_FILES):
            raise RefusedError(400, f"needed is a kind ({', '.join(KINDS)}) and a list of files")
        files = [self._file(key) for key in keys]
        job = await self.jobs.start(kind, request | {"names": [f.name for f in files]}, files)
        self.answer(job.as_json())

    def _file(self, key: Any) -> Path:
        """A dropped file by its key, or one that a job has written, JOB/NAME."""
        if isinstance(key, str) and "/" in key:
            job, _, name = key.partition("/")
            return self.jobs.find(job).written(name)
        return self.uploads.find(key).path


class RunningJob(GuardedHandler):
    """How a job stands."""

    def initialize(self, jobs: Jobs) -> None:
        """Take the jobs."""
        self.jobs = jobs

    def get(self, key: str) -> None:
        """Answer."""
        self.answer(self.jobs.find(key).as_json())

    async def delete(self, key: str) -> None:
        """Cancel it."""
        job = self.jobs.find(key)
        await self.jobs.cancel(job)
        self.answer(job.as_json())


class JobFile(GuardedHandler):
    """A file that a job has written: shown where it is a report, otherwise saved."""

    def initialize(self, jobs: Jobs) -> None:
        """Take the jobs."""
        self.jobs = jobs

    def get(self, key: str, name: str) -> None:
        """Send it, if the answer of the job lists it."""
        path = self.jobs.find(key).written(name)
        shown = path.suffix == ".html" and self.get_query_argument("show", "") == "1"
        self.set_header("Content-Type", f"{_TYPES.get(path.suffix, 'text/plain')}; charset=utf-8")
        self.set_header("Content-Security-Policy", REPORT_POLICY)
        if not shown:
            self.set_header("Content-Disposition", f'attachment; filename="{name}"')
        self.finish(path.read_bytes())
