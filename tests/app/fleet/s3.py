"""An S3 on this machine that fails every n-th request, as stores do."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from moto.server import DomainDispatcherApplication, create_backend_app
from werkzeug.serving import make_server

BUCKET = "fleet"


class Unsteady:
    """A WSGI program in which every n-th request fails. It counts requests."""

    def __init__(self, program: Callable[..., Iterable[bytes]], every: int) -> None:
        self._program, self._lock = program, threading.Lock()
        self.every = every
        self.requests = self.failed = 0

    def __call__(self, environ: dict[str, Any], start: Callable[..., Any]) -> Iterable[bytes]:
        with self._lock:
            self.requests += 1
            fails = bool(self.every) and self.requests % self.every == 0
            self.failed += fails
        if fails:
            length = int(environ.get("CONTENT_LENGTH") or 0)
            environ["wsgi.input"].read(length)
            start("503 Slow Down", [("Content-Type", "text/plain"), ("Content-Length", "0")])
            return [b""]
        return self._program(environ, start)


@contextmanager
def s3_server(monkeypatch: Any, every: int) -> Iterator[Unsteady]:
    """A server with one empty bucket; programs started meanwhile use it."""
    program = Unsteady(DomainDispatcherApplication(create_backend_app), 0)
    server = make_server("127.0.0.1", 0, program, threaded=True)
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    try:
        monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://127.0.0.1:{server.server_port}")
        for name, value in (("ACCESS_KEY_ID", "test"), ("SECRET_ACCESS_KEY", "test"), ("DEFAULT_REGION", "us-east-1")):
            monkeypatch.setenv(f"AWS_{name}", value)
        import boto3
        import s3fs
        from moto.backends import get_backend

        get_backend("s3").reset()  # it is one for all servers of this process

        s3fs.S3FileSystem.clear_instance_cache()  # those of an earlier server
        boto3.client("s3").create_bucket(Bucket=BUCKET)
        program.every = every
        yield program
    finally:
        server.shutdown()
        thread.join()
        server.server_close()
