"""rerun's web viewer, taken out of the installed program and served by us."""

from __future__ import annotations

import stat
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import httpx
import pytest

from app.views.rerun.web import FILES, NoViewer, ViewerFiles
from app.web.server import create_app
from tests.app.web.serving import WAIT_S, running, serving


@pytest.fixture(scope="module")
def client() -> Iterator[httpx.Client]:
    """A real server on a small drive."""
    with running(whole_drives=True) as engine:
        engine.wait_for(lambda shown: shown.drive.run is not None, WAIT_S)
        with serving(create_app(engine)) as address, httpx.Client(base_url=address, timeout=WAIT_S) as client:
            yield client


def test_the_viewer_is_opened_at_the_shown_frame_with_every_file_from_here(client: httpx.Client):
    address = client.get("/api/rerun/open").json()
    assert (address["url"], address["first"], address["last"]) == ("/rerun/?first=0&last=29&paused=1&compact=0", 0, 29)
    later = client.get("/api/rerun/open?first=7&compact=1").json()
    assert (later["url"], later["first"]) == ("/rerun/?first=7&last=29&paused=1&compact=1", 7)
    page = client.get(address["url"])
    policy = page.headers["content-security-policy"]
    assert "connect-src 'self' blob: data:" in policy
    assert "http" not in policy, "nobody else may be asked for anything"
    assert "unsafe-eval" not in policy.replace("'wasm-unsafe-eval'", "")
    script, program = (client.get(f"/rerun/{name}") for name in FILES)
    assert script.headers["content-type"].startswith("text/javascript")
    assert "WebHandle" in script.text
    assert (program.headers["content-type"], program.content[:4]) == ("application/wasm", b"\0asm")
    assert client.get("/rerun/page.js").status_code == 200


@pytest.mark.parametrize("name", ["rerun", "..%2f..%2fpyproject.toml", "home"])
def test_nothing_else_is_served_there(client: httpx.Client, name: str):
    assert client.get(f"/rerun/{name}").status_code == 404


@pytest.fixture
def program(tmp_path: Path) -> Callable[[str], Path]:
    """A stand-in for the rerun program: a Python script with this body."""

    def write(body: str) -> Path:
        file = tmp_path / "rerun"
        file.write_text(f"#!{sys.executable}\n{body}\n", encoding="utf-8")
        file.chmod(file.stat().st_mode | stat.S_IXUSR)
        return file

    return write


def test_a_program_without_a_viewer_is_told_in_one_sentence(program: Callable[[str], Path]):
    viewer = ViewerFiles(program("raise SystemExit(3)"))
    with pytest.raises(NoViewer, match="ended without serving"):
        viewer.path(FILES[0])
    viewer.close()


def test_a_program_that_is_not_there_is_told_in_one_sentence(tmp_path: Path):
    with pytest.raises(NoViewer, match="cannot be started"):
        ViewerFiles(tmp_path / "nowhere").path(FILES[0])
    with pytest.raises(NoViewer, match="no file"):
        ViewerFiles().path("../../etc/passwd")


_SERVES = """
import http.server, os, sys
assert os.environ["CI"] == "true" and os.environ["HOME"] != os.path.expanduser("~root"), os.environ
assert sys.argv[sys.argv.index("--bind") + 1] == "127.0.0.1"
class Handler(http.server.BaseHTTPRequestHandler):
    def do_GET(self):
        self.send_response(200)
        self.end_headers()
        self.wfile.write(self.path.encode())
    def log_message(self, *args):
        pass
port = int(sys.argv[sys.argv.index("--web-viewer-port") + 1])
http.server.HTTPServer(("127.0.0.1", port), Handler).serve_forever()
"""


def test_the_files_are_fetched_once_over_loopback_and_removed_at_the_end(program: Callable[[str], Path]):
    viewer = ViewerFiles(program(_SERVES))
    script = viewer.path(FILES[0])
    assert script.read_text() == f"/{FILES[0]}"
    program("raise SystemExit(3)")
    assert viewer.path(FILES[1]).read_text() == f"/{FILES[1]}", "the program is not asked again"
    assert sorted(file.name for file in script.parent.iterdir()) == sorted(FILES)
    viewer.close()
    assert not script.parent.exists()
