"""An S3 server in its own process, which stores objects on disk and fails every n-th request.

python -m tests.soak.fleet.store EVERY
"""

from __future__ import annotations

import logging
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from tests.conftest import ROOT

BUCKET = "fleet"
ENVIRONMENT = {
    "AWS_ACCESS_KEY_ID": "test",
    "AWS_SECRET_ACCESS_KEY": "test",
    "AWS_DEFAULT_REGION": "us-east-1",
    "MOTO_S3_DEFAULT_KEY_BUFFER_SIZE": "65536",
}
"""The last variable: larger objects go to temporary files."""


@contextmanager
def s3_process(every: int) -> Iterator[str]:
    """The address of a server with one empty bucket, to be set as ``AWS_ENDPOINT_URL``. every: every n-th request
    fails, 0 for none; POST /every/N changes it."""
    typed = [sys.executable, "-m", "tests.soak.fleet.store", str(every)]
    environment = os.environ | ENVIRONMENT | {"PYTHONPATH": str(ROOT)}
    with subprocess.Popen(typed, cwd=ROOT, env=environment, stdout=subprocess.PIPE, text=True) as server:
        try:
            assert server.stdout is not None
            yield server.stdout.readline().strip()
        finally:
            server.kill()


def main(every: int) -> None:
    """Serve until killed."""
    from moto.server import DomainDispatcherApplication, create_backend_app
    from werkzeug.serving import make_server

    from tests.app.fleet.s3 import Unsteady

    logging.getLogger("werkzeug").setLevel(logging.ERROR)
    program = Unsteady(DomainDispatcherApplication(create_backend_app), 0)
    inner = program._program

    def switched(environ, start):  # type: ignore[no-untyped-def]
        path = environ["PATH_INFO"]
        if path.startswith("/every/"):
            program.every = int(path.rpartition("/")[2])
            start("200 OK", [("Content-Type", "text/plain")])
            return [f"{program.requests} {program.failed}\n".encode()]
        return inner(environ, start)

    program._program = switched
    server = make_server("127.0.0.1", 0, program, threaded=True)
    print(f"http://127.0.0.1:{server.server_port}", flush=True)
    program.every = every
    server.serve_forever()


if __name__ == "__main__":
    main(int(sys.argv[1]))
