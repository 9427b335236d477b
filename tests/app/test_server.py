"""The API over a running engine, as scripts and pages use it."""

from __future__ import annotations

import asyncio
import http.client
import json
import socket
import struct
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import httpx
import pytest
import yaml
from websockets.exceptions import InvalidStatus
from websockets.sync.client import ClientConnection, connect

from app.engine import Engine
from app.looks import Looks
from app.server import PortTaken, Server, create_app, listen_socket
from app.snapshot import Snapshot
from pipeline.params import Params, from_yaml
from pipeline.results import to_json
from pipeline.types import REAL_VEHICLES
from tests.app.recording import CountingDetector, Recording, opener
from tests.app.waiting import loop_apart

WAIT_S = 60.0


@pytest.fixture(scope="module")
def engine() -> Iterator[Engine]:
    """Two recordings, the first one open."""
    first, second = Recording(), Recording("test:other", count=5)
    engine = Engine(opener(first, second), lambda _: CountingDetector(), Params(), uri=first.uri)
    engine.start()
    engine.wait_for(lambda shown: shown.tick is not None, WAIT_S)
    yield engine
    engine.stop()


@pytest.fixture(scope="module")
def looks() -> Looks:
    return Looks()


@pytest.fixture(scope="module")
def address(engine: Engine, looks: Looks) -> Iterator[str]:
    """Where a real server answers."""
    bound = listen_socket("127.0.0.1", 0)
    address = f"http://127.0.0.1:{bound.getsockname()[1]}"
    is_ready = threading.Event()
    server = Server(create_app(engine, looks=looks), address, lambda _: is_ready.set())
    thread = threading.Thread(target=lambda: server.run(sockets=[bound]))
    thread.start()
    assert is_ready.wait(WAIT_S)
    yield address
    server.should_exit = True
    thread.join()
    bound.close()


@pytest.fixture(scope="module")
def client(address: str) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=address, timeout=WAIT_S) as client:
        yield client


@pytest.fixture
def stream(address: str) -> Callable[..., ClientConnection]:
    """Opens a stream, as a page of the server's own origin unless told otherwise."""

    def begin(query: str = "", **headers: str) -> ClientConnection:
        own = {"origin": address} | headers
        url = address.replace("http", "ws") + "/api/stream" + query
        return connect(url, additional_headers=own, max_size=None, open_timeout=WAIT_S, compression=None)

    return begin


@pytest.fixture(autouse=True)
def _at_the_start(engine: Engine) -> None:
    """Each test begins at the first frame of the first recording with default parameters."""
    before = engine.snapshot.sequence
    engine.control.set_params(Params(), "default")
    engine.control.change(uri="test:car", playing=False, target=None, steps=0)
    engine.wait_for(
        lambda s: s.sequence > before and s.uri == "test:car" and s.index == 0 and s.tick is not None, WAIT_S
    )


def reach(engine: Engine, condition: Callable[[Snapshot], bool]) -> Snapshot:
    return engine.wait_for(condition, WAIT_S)


def header_of(message: bytes) -> dict[str, Any]:
    (length,) = struct.unpack_from("<I", message)
    return json.loads(message[4 : 4 + length])


def next_frame(socket: ClientConnection) -> dict[str, Any]:
    while True:
        message = socket.recv(WAIT_S)
        if isinstance(message, bytes):
            return header_of(message)


def next_text(socket: ClientConnection, wanted: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
    while True:
        message = socket.recv(WAIT_S)
        if isinstance(message, str) and wanted(json.loads(message)):
            return json.loads(message)


# ------------------------------------------------------------ reading


def test_health_state_and_result(client: httpx.Client, engine: Engine):
    assert client.get("/api/healthz").json() == {"status": "ok", "engine": True}
    assert client.get("/api/state").json()["title"] == "a car"
    tick = engine.snapshot.tick
    assert tick is not None
    assert client.get("/api/result").json() == json.loads(json.dumps(to_json(tick.result)))


def test_every_parameter_is_described_with_bounds_unit_and_help(client: httpx.Client):
    answer = client.get("/api/params").json()
    described = {f"{s['name']}.{p['key']}": p for s in answer["sections"] for p in s["params"]}
    assert described.keys() == answer["values"].keys() == answer["base"].keys()
    assert all(p["help"] for p in described.values())
    numbers = [p for p in described.values() if p["kind"] in ("number", "integer")]
    assert numbers
    assert all(p["min"] < p["max"] and p["step"] > 0 for p in numbers)
    assert described["cluster.tolerance_m"]["unit"] == "m"
    assert described["alignment.model"]["choices"] == ["angular", "pinhole"]
    assert described["alignment.h_res_deg"]["nullable"]


def test_what_null_means_comes_from_the_calibration(client: httpx.Client):
    effective = client.get("/api/params").json()["effective"]
    assert effective["alignment.h_res_deg"] == pytest.approx(57.29578 / 250, abs=1e-4)
    assert effective["alignment.cx_px"] == 160.0


def test_what_null_means_of_the_distance_law_is_the_detectors_own(client: httpx.Client):
    answer = client.get("/api/params").json()
    assert answer["values"]["distance.coefficient"] is None
    assert answer["effective"]["distance.coefficient"] == REAL_VEHICLES.coefficient
    assert answer["effective"]["distance.truck_ratio"] == REAL_VEHICLES.truck_ratio
    try:
        client.patch("/api/params", json={"changes": {"distance.reference_focal_px": 907.0 * 2}})
        effective = client.get("/api/params").json()["effective"]
        assert effective["distance.coefficient"] == pytest.approx(2 * REAL_VEHICLES.coefficient), "boxes twice as tall"
    finally:
        client.patch("/api/params", json={"changes": {"distance.reference_focal_px": 907.0}})


def test_the_saved_file_is_taken_back_by_the_command_line(client: httpx.Client, tmp_path: Path):
    client.patch("/api/params", json={"changes": {"cluster.z_weight": 0.65}})
    file = tmp_path / "saved.yaml"
    file.write_bytes(client.get("/api/params.yaml").content)
    assert yaml.safe_load(file.read_text())["cluster"]["z_weight"] == 0.65
    assert from_yaml(file, Params()).cluster.z_weight == 0.65


def test_scenarios_are_offered(client: httpx.Client):
    assert "sim:straight" in [each["uri"] for each in client.get("/api/sources").json()["sources"]]


def test_the_api_describes_itself(client: httpx.Client):
    paths = client.get("/openapi.json").json()["paths"]
    assert {"/api/state", "/api/params", "/api/playback", "/api/source", "/api/result"} <= paths.keys()
    operations = [operation for path in paths.values() for operation in path.values()]
    assert all(operation.get("summary") and operation.get("description") for operation in operations)


# ------------------------------------------------------------ changing


def test_playback_is_obeyed(client: httpx.Client, engine: Engine):
    client.post("/api/playback", json={"seek": 12})
    reach(engine, lambda s: s.index == 12)
    client.post("/api/playback", json={"step": -2})
    reach(engine, lambda s: s.index == 10)
    client.post("/api/playback", json={"playing": True, "speed": 4.0, "loop": False})
    assert reach(engine, lambda s: s.playing and s.index > 10).speed == 4.0


def test_a_changed_parameter_is_in_the_next_result(client: httpx.Client, engine: Engine):
    before = client.get("/api/result").json()
    answer = client.patch("/api/params", json={"changes": {"detection.min_score": 0.9}}).json()
    reach(engine, lambda s: s.params_revision == answer["revision"])
    assert client.get("/api/result").json()["objects"] != before["objects"]
    assert answer["values"]["detection.min_score"] == 0.9
    assert answer["base"]["detection.min_score"] == Params().detection.min_score


def test_a_preset_replaces_everything(client: httpx.Client):
    client.patch("/api/params", json={"changes": {"cluster.z_weight": 0.65}})
    answer = client.post("/api/params/preset", json={"name": "paper"}).json()
    assert answer["preset"] == "paper"
    assert answer["values"] == answer["base"]
    assert answer["values"]["alignment.model"] == "angular"


def test_another_recording_is_opened(client: httpx.Client, engine: Engine):
    assert client.post("/api/source", json={"uri": "test:other"}).status_code == 202
    assert reach(engine, lambda s: s.uri == "test:other" and s.tick is not None).count == 5


REFUSED = {
    "unknown parameter": ("PATCH", "/api/params", {"changes": {"cluster.nonsense": 1}}, "cluster.nonsense"),
    "out of bounds": ("PATCH", "/api/params", {"changes": {"cluster.z_weight": 7}}, "cluster.z_weight"),
    "not a number": ("PATCH", "/api/params", {"changes": {"cluster.z_weight": "much"}}, "cluster.z_weight"),
    "no changes": ("PATCH", "/api/params", {"changes": {}}, "changes"),
    "unknown preset": ("POST", "/api/params/preset", {"name": "nonsense"}, "nonsense"),
    "negative seek": ("POST", "/api/playback", {"seek": -1}, "seek"),
    "speed of nothing": ("POST", "/api/playback", {"speed": 0}, "speed"),
    "unknown field": ("POST", "/api/playback", {"rewind": True}, "rewind"),
    "no source": ("POST", "/api/source", {"uri": ""}, "uri"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_bad_input_is_refused_with_one_sentence(client: httpx.Client, name: str):
    method, path, body, about = REFUSED[name]
    before = client.get("/api/params").json()["values"]
    answer = client.request(method, path, json=body)
    assert answer.status_code == 422
    assert about in answer.json()["detail"]
    assert "\n" not in answer.json()["detail"]
    assert client.get("/api/params").json()["values"] == before


def test_what_is_picked_in_the_3d_view_comes_to_the_pages(looks: Looks, stream: Callable[..., ClientConnection]):
    page = stream()
    page.recv(timeout=WAIT_S)
    looks.pick(7)
    told = (json.loads(words) for words in page if isinstance(words, str))
    assert next(word for word in told if word["type"] == "selected") == {"type": "selected", "id": 7}


# ------------------------------------------------------------ strangers


@pytest.mark.parametrize("path", ["/api/playback", "/api/source", "/api/params/preset"])
def test_a_foreign_page_changes_nothing(client: httpx.Client, path: str):
    answer = client.post(path, json={}, headers={"origin": "http://evil.example"})
    assert answer.status_code == 403


def test_a_foreign_page_has_nothing_computed(client: httpx.Client):
    for path in ("/api/result", "/api/drive/events"):
        assert client.get(path, headers={"sec-fetch-site": "cross-site"}).status_code == 403
        assert client.get(path, headers={"sec-fetch-site": "same-origin"}).status_code == 200


def test_a_rebound_name_reads_nothing(client: httpx.Client):
    assert client.get("/api/state", headers={"host": "evil.example"}).status_code == 403
    assert client.get("/", headers={"host": "evil.example"}).status_code == 403


def test_a_foreign_page_gets_no_stream(stream: Callable[..., ClientConnection]):
    with pytest.raises(InvalidStatus, match="403"):
        stream(origin="http://evil.example")


def test_a_rebound_name_gets_no_stream(client: httpx.Client):
    upgrade = {
        "host": "evil.example",
        "origin": "http://evil.example",
        "connection": "Upgrade",
        "upgrade": "websocket",
        "sec-websocket-version": "13",
        "sec-websocket-key": "dGhlIHNhbXBsZSBub25jZQ==",
    }
    assert client.get("/api/stream", headers=upgrade).status_code == 403


OUTSIDE = [
    "/../app/server.py",
    "/%2e%2e/pyproject.toml",
    "/js/..%2f..%2fpyproject.toml",
    "/..%5cREADME.md",
    "//etc/passwd",
]


@pytest.mark.parametrize("path", OUTSIDE)
def test_files_outside_the_page_are_not_served(address: str, path: str):
    connection = http.client.HTTPConnection(urlsplit(address).netloc, timeout=WAIT_S)
    connection.request("GET", path)
    assert connection.getresponse().status == 404
    connection.close()


@pytest.mark.parametrize("path", ["/", "/js/main.js", "/palette.css", "/api/state"])
def test_security_headers(client: httpx.Client, path: str):
    answer = client.get(path)
    assert answer.status_code == 200
    policy = answer.headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    assert answer.headers["x-content-type-options"] == "nosniff"


# ------------------------------------------------------------ stream


def test_whoever_joins_late_gets_the_current_frame_at_once(
    client: httpx.Client, engine: Engine, stream: Callable[..., ClientConnection]
):
    client.post("/api/playback", json={"seek": 9})
    reach(engine, lambda s: s.index == 9)
    for _ in range(2):
        with stream() as socket:
            assert next_frame(socket)["result"]["frame"] == "000009"


def test_a_frame_reaches_every_client(client: httpx.Client, stream: Callable[..., ClientConnection]):
    with stream() as one, stream() as other:
        next_frame(one)
        next_frame(other)
        client.post("/api/playback", json={"seek": 4})
        assert next_frame(one) == next_frame(other)


def test_a_page_that_paints_slowly_is_sent_nothing_ahead_and_then_the_newest(
    client: httpx.Client, stream: Callable[..., ClientConnection]
):
    with stream("?paced=1") as slow, stream() as reader:
        next_frame(reader)
        for index in range(1, 9):
            client.post("/api/playback", json={"seek": index})
            while next_frame(reader)["state"]["index"] != index:
                pass
        got = [next_frame(slow)["state"]["index"] for _ in range(2)]
        assert got[-1] < 8, "what it had not asked for was not sent ahead"
        slow.send('{"painted": true}')
        assert next_frame(slow)["state"]["index"] == 8


def test_a_change_without_a_new_frame_is_told_too(client: httpx.Client, stream: Callable[..., ClientConnection]):
    with stream() as socket:
        next_frame(socket)
        client.post("/api/playback", json={"loop": False, "speed": 2.0})
        assert next_text(socket, lambda m: m["state"]["speed"] == 2.0)


def test_a_ping_comes_back_with_the_servers_clock_and_rubbish_is_ignored(stream: Callable[..., ClientConnection]):
    with stream() as socket:
        for rubbish in ("", "{", "[1]", '{"ping": "x"}', '{"ping": NaN}', "[" * 5000):
            socket.send(rubbish)
        socket.send('{"ping": 17.5}')
        pong = next_text(socket, lambda m: m["type"] == "pong")
        assert pong["ping"] == 17.5
        assert pong["server_unix_ms"] > 1.6e12


# ------------------------------------------------------------ ports


def test_small_messages_are_not_held_back():
    """asyncio sets TCP_NODELAY on what it accepts only where the listening socket names its protocol."""

    async def accepted_delay() -> int:
        loop = asyncio.get_running_loop()
        found: asyncio.Future[int] = loop.create_future()

        class Probe(asyncio.Protocol):
            def connection_made(self, transport: asyncio.BaseTransport) -> None:
                accepted = transport.get_extra_info("socket")
                found.set_result(accepted.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY))
                transport.close()

        bound = listen_socket("127.0.0.1", 0)
        async with await loop.create_server(Probe, sock=bound):
            _, writer = await asyncio.open_connection(*bound.getsockname())
            no_delay = await found
            writer.close()
            await writer.wait_closed()
            return no_delay

    with loop_apart() as run:
        assert run(accepted_delay())


def test_a_taken_port_is_said_or_passed_over():
    held = listen_socket("127.0.0.1", 0)
    held.listen()
    port = held.getsockname()[1]
    with held:
        with pytest.raises(PortTaken, match=str(port)):
            listen_socket("127.0.0.1", port, strict=True)
        with listen_socket("127.0.0.1", port) as free:
            assert port < free.getsockname()[1] <= port + 20
