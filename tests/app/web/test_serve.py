"""The server as a program: it says where it is, answers there, and ends at once on Ctrl-C."""

from __future__ import annotations

import json
import os
import signal
import socket
import ssl
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from urllib.parse import urlsplit

import httpx
import pytest
from websockets.sync.client import connect

from app.core.server_address import listen_socket
from app.engine.engine import Engine
from app.web.serve import serve
from app.web.server import Server
from pipeline.common.errors import BadInput
from pipeline.params import Params
from tests.app.engine.recording_helpers import Recording, opener
from tests.app.waiting import WAIT_S
from tests.app.web.serving import certificate

ROOT = Path(__file__).resolve().parents[3]
PROGRAM = """
import sys
from app.engine.engine import Engine
from app.web.serve import serve
from pipeline.common.errors import BadInput
from pipeline.params import Params
from tests.app.engine.recording_helpers import CountingDetector, Recording, opener
engine = Engine(opener(Recording()), lambda _: CountingDetector(), Params(), uri="test:car", playing=True)
serve(engine, port=int(sys.argv[1]), host=sys.argv[2])
"""


def begun(program: str, *arguments: str, **variables: str) -> subprocess.Popen[str]:
    """A Python program with arguments and environment variables, whose output is read."""
    return subprocess.Popen(
        [sys.executable, "-c", program, *arguments],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(ROOT)} | variables,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.fixture
def taken_port() -> Iterator[int]:
    """A port that another program listens on."""
    with listen_socket("127.0.0.1", 0) as held:
        held.listen()
        yield held.getsockname()[1]


def test_two_servers_of_one_machine_keep_their_parameters_apart(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    ports: list[int] = []
    monkeypatch.setattr(Server, "run", lambda _, sockets: ports.append(sockets[0].getsockname()[1]))
    engine = Engine(opener(Recording()), None, Params())
    monkeypatch.setattr("app.web.serve.SESSIONS", tmp_path)
    serve(engine, port=0)
    assert engine.labels.kept.station == f"{socket.gethostname()}:{ports[0]}"


def test_it_passes_over_a_taken_port_answers_and_ends_with_open_streams(taken_port: int):
    program = begun(PROGRAM, str(taken_port), "127.0.0.1")
    try:
        assert program.stdout is not None
        address = program.stdout.readline().strip()
        port = int(address.removeprefix("http://127.0.0.1:"))
        assert taken_port < port <= taken_port + 20
        assert httpx.get(f"{address}/api/healthz", timeout=60).json()["status"] == "ok"
        with connect(f"{address.replace('http', 'ws')}/api/stream", max_size=None) as stream:
            stream.recv(60)
            program.send_signal(signal.SIGINT)
            _, errors = program.communicate(timeout=WAIT_S)
        assert program.returncode == 0
        assert errors.strip() == f"cipv: port {taken_port} is in use; using {port}"
    finally:
        program.kill()
        program.wait()


def test_for_other_machines_it_shows_links_with_tokens_and_lets_nobody_else_in():
    token = "chosen-for-the-display-1234"
    program = begun(PROGRAM, "0", "0.0.0.0", CIPV_DISPLAY_TOKEN=token)
    try:
        assert program.stdout is not None
        address, person, display = (program.stdout.readline().strip() for _ in range(3))
        port = urlsplit(address).port
        assert "0.0.0.0" not in address
        assert person.startswith(f"full access:        {address}/?token=")
        assert display == f"in-vehicle display: {address}/drive/?token=$CIPV_DISPLAY_TOKEN"
        here = f"http://127.0.0.1:{port}"
        assert httpx.get(f"{here}/api/state", timeout=60).status_code == 401
        assert httpx.get(f"{here}/healthz", timeout=60).status_code == 200
        with httpx.Client(base_url=here, timeout=60) as client:
            assert client.get("/", params={"token": person.partition("token=")[2]}).status_code == 200
            assert client.get("/api/state").json()["speed"] == 1.0
        program.send_signal(signal.SIGINT)
        out, errors = program.communicate(timeout=WAIT_S)
        assert out == ""
        assert "token" not in errors, "it is shown once"
    finally:
        program.kill()


RECORDING = PROGRAM.replace("playing=True", "playing=True, recorder=SessionRecorder(Path(sys.argv[3]))").replace(
    "import sys", "import sys\nfrom pathlib import Path\nfrom app.engine.session_recording import SessionRecorder"
)


@pytest.mark.parametrize("numbers", [[signal.SIGINT], [signal.SIGTERM], [signal.SIGHUP, signal.SIGTERM]])
def test_whoever_ends_it_its_recording_is_closed_first(tmp_path: Path, numbers: list[signal.Signals]):
    program = begun(RECORDING, "0", "127.0.0.1", str(tmp_path))
    try:
        assert program.stdout is not None
        with httpx.Client(base_url=program.stdout.readline().strip(), timeout=60) as client:
            client.post("/api/recording", json={"on": True}).raise_for_status()
            with connect(f"{client.base_url}/api/stream".replace("http", "ws"), max_size=None) as stream:
                while (client.get("/api/state").json()["recording"] or {"frames": 0})["frames"] < 2:
                    stream.recv(60)  # a frame or a state: something has happened
                for number in numbers:
                    program.send_signal(number)
                program.communicate(timeout=60)
        assert program.returncode == 0
        (session,) = tmp_path.iterdir()
        assert session.read_bytes().endswith(b"\x89MCAP0\r\n"), "its index and its end are there"
    finally:
        program.kill()
        program.communicate()


HANGING = """
import sys, threading
from pathlib import Path
from app.commands.serve import ServerOptions
from app.engine.engine import Engine
from app.engine.session_recording import SessionRecorder
from app.labels.service.desk import LabelDesk
from pipeline.params import Params
from tests.app.engine.recording_helpers import CountingDetector, Recording, opener

def for_ever():
    print("hangs", flush=True)
    threading.Event().wait()

class Hanging(Recording):
    def frame(self, index):
        return super().frame(index) if index != 7 else for_ever()

engine = Engine(opener(Hanging()), lambda _: CountingDetector(), Params(), uri="test:car",
                recorder=SessionRecorder(Path(sys.argv[1])), labels=LabelDesk(open_later=for_ever))
ServerOptions(port=int(sys.argv[2])).serve(engine)
"""


def test_disks_and_databases_that_hang_for_ever_keep_neither_the_recording_open_nor_the_program_alive(
    tmp_path: Path,
) -> None:
    with listen_socket("127.0.0.1", 0) as free:
        port = free.getsockname()[1]
    program = begun(HANGING, str(tmp_path), str(port))
    try:
        assert program.stdout is not None
        said = [program.stdout.readline()]
        while not said[-1].startswith("http"):
            said.append(program.stdout.readline())
        with httpx.Client(base_url=said[-1].strip(), timeout=60) as client:
            client.post("/api/recording", json={"on": True}).raise_for_status()
            client.post("/api/playback", json={"seek": 3, "playing": True}).raise_for_status()
            while said.count("hangs\n") < 2:  # the database, and the engine's disk
                said.append(program.stdout.readline())
            with connect(f"{client.base_url}/api/stream?own=7".replace("http", "ws"), max_size=None) as page:
                page.send('{"ping": 1}')
                page.recv(60)
                program.send_signal(signal.SIGTERM)
                _, errors = program.communicate(timeout=60)
        assert program.returncode == 0
        assert errors.splitlines()[-1] == "cipv: exited without waiting for hung work; the recording is closed"
        (session,) = tmp_path.iterdir()
        assert session.read_bytes().endswith(b"\x89MCAP0\r\n"), "its index and its end are there"
    finally:
        program.kill()
        program.communicate()


FREED = """
import sys
from app.commands.serve import ServerOptions
from app.engine.engine import Engine
from pipeline.params import Params
from tests.app.engine.recording_helpers import CountingDetector, Recording, opener

class Kept:
    def __del__(self):
        print("freed", flush=True)

kept = Kept()
ServerOptions(port=int(sys.argv[1])).serve(Engine(opener(Recording()), lambda _: CountingDetector(), Params()))
"""


def test_it_does_not_free_its_memory_before_it_exits() -> None:
    """A second of processor time and more, which on a busy machine exceeds the 5 s that supervisors wait."""
    with listen_socket("127.0.0.1", 0) as free:
        port = free.getsockname()[1]
    program = begun(FREED, str(port))
    try:
        assert program.stdout is not None
        assert program.stdout.readline().startswith("http")
        program.send_signal(signal.SIGTERM)
        said, _ = program.communicate(timeout=WAIT_S)
        assert (program.returncode, said) == (0, "")
    finally:
        program.kill()
        program.communicate()


def test_https_with_a_token_on_this_machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    cert, key = certificate(tmp_path)
    monkeypatch.setattr("app.web.serve.SESSIONS", tmp_path)
    answers: list[httpx.Response] = []
    asked = threading.Event()
    monkeypatch.setattr("app.web.serve.asked_to_stop", lambda: nullcontext(asked))

    def ask(link: str) -> None:
        with httpx.Client(verify=ssl.create_default_context(cafile=str(cert)), timeout=60) as client:
            answers.append(client.get(f"{link.partition('?')[0]}api/state"))
            answers.append(client.get(link))
            answers.append(client.post(f"{link.partition('?')[0]}api/playback", json={"playing": False}))
        asked.set()

    engine = Engine(opener(Recording()), None, Params(), uri="test:car")
    serve(engine, port=0, always_token=True, tls=(cert, key), on_ready=ask)
    assert [answer.status_code for answer in answers] == [401, 200, 202]
    assert answers[1].url.scheme == "https"
    assert "secure" in answers[1].headers["set-cookie"].lower()
    (entry,) = map(json.loads, (tmp_path / "audit.jsonl").read_text().splitlines())
    assert (entry["role"], entry["method"], entry["path"], entry["status"]) == ("person", "POST", "/api/playback", 202)
    assert json.loads(entry["body"]) == {"playing": False}
    assert (tmp_path / "audit.jsonl").stat().st_mode & 0o077 == 0
    with pytest.raises(BadInput, match="swapped"):
        serve(Engine(opener(Recording()), None, Params()), port=0, tls=(key, cert))
