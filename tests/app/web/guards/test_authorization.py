"""A server that other machines can reach, met by those who should not get in: the hostile page, the rebound name, the
path traverser, the endless upload, and a display that wants to be more."""

from __future__ import annotations

import http.client
import tempfile
from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path
from urllib.parse import urlsplit

import httpx
import pytest
from fastapi import FastAPI
from websockets.exceptions import ConnectionClosedError, InvalidStatus
from websockets.sync.client import connect

from app.engine.engine import Engine
from app.engine.session_recording import SessionRecorder
from app.web.guards.limits import LARGEST_BODY, LARGEST_FILE
from app.web.guards.tokens import Tokens
from app.web.routes.labels.files import IMPORT
from app.web.server import create_app
from tests.app.web.serving import WAIT_S, running, serving

TOKENS = Tokens("person-0123456789abcdef", "display-0123456789abcde")
EVIL = "http://evil.example"


@pytest.fixture(scope="module")
def engine(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Engine]:
    with running(SessionRecorder(tmp_path_factory.mktemp("sessions"))) as engine:
        yield engine


@pytest.fixture(scope="module")
def app(engine: Engine) -> FastAPI:
    return create_app(engine, hosts=["0.0.0.0"], tokens=TOKENS)


@pytest.fixture(scope="module")
def address(app: FastAPI) -> Iterator[str]:
    with serving(app) as address:
        yield address


Visitor = Callable[[str], httpx.Client]


@pytest.fixture(scope="module")
def visitor(address: str) -> Iterator[Visitor]:
    """A client that used the link of a role, or none."""
    clients: list[httpx.Client] = []

    def come(role: str) -> httpx.Client:
        client = httpx.Client(base_url=address, timeout=WAIT_S)
        clients.append(client)
        if role != "nobody":
            assert client.get("/", params={"token": getattr(TOKENS, role)}).status_code == 200
        return client

    yield come
    for client in clients:
        client.close()


# ------------------------------------------------------------ the link


def test_a_link_becomes_a_strict_cookie_and_the_token_leaves_the_address(address: str):
    answer = httpx.get(f"{address}/drive/?token={TOKENS.display}&x=%22%3E", timeout=WAIT_S)
    cookie = answer.headers["set-cookie"].lower()
    assert answer.status_code == 200
    assert "httponly" in cookie
    assert "samesite=strict" in cookie
    assert 'content="0; url=/drive/?x=%22%3E"' in answer.text
    assert TOKENS.display not in answer.text
    assert answer.headers["cache-control"] == "no-store"
    assert answer.headers["referrer-policy"] == "no-referrer"


def test_a_link_leads_nowhere_else(address: str):
    connection = http.client.HTTPConnection(urlsplit(address).netloc, timeout=WAIT_S)
    connection.request("GET", f"//evil.example/%22%3E?token={TOKENS.person}")
    page = connection.getresponse().read().decode()
    connection.close()
    assert 'content="0; url=/evil.example/%22%3E"' in page


def test_a_program_sends_its_token_as_bearer(address: str):
    def status(**headers: str) -> int:
        return httpx.get(f"{address}/metrics", headers=headers, timeout=WAIT_S).status_code

    assert status(authorization=f"Bearer {TOKENS.display}") == 200
    assert status(authorization="Bearer something-else-entirely") == 401
    assert status(authorization=f"Basic {TOKENS.display}") == 401
    assert status() == 401


def test_a_wrong_link_gives_no_cookie_and_says_what_to_do(address: str):
    answer = httpx.get(f"{address}/?token=guessed-guessed-guessed", headers={"accept": "text/html"}, timeout=WAIT_S)
    assert answer.status_code == 401
    assert "set-cookie" not in answer.headers
    assert "terminal" in answer.text


# ------------------------------------------------------------ roles

DOORS = {
    # method, path, body: nobody, display, person
    "the page": ("GET", "/", None, 401, 200, 200),
    "the page's parts": ("GET", "/js/main.js", None, 401, 200, 200),
    "the display's page": ("GET", "/drive/", None, 401, 200, 200),
    "the state": ("GET", "/api/state", None, 401, 200, 200),
    "the figures": ("GET", "/metrics", None, 401, 200, 200),
    "that it lives": ("GET", "/healthz", None, 200, 200, 200),
    "a mark": ("POST", "/api/marks", {"text": ""}, 401, 201, 201),
    "ending a recording": ("POST", "/api/recording", {"on": False}, 401, 200, 200),
    "taking a mark away": ("DELETE", "/api/marks/999", None, 401, 403, 404),
    "parameters": ("PATCH", "/api/params", {"changes": {"cluster.z_weight": 0.5}}, 401, 403, 200),
    "all parameters": ("POST", "/api/params", {"preset": "default"}, 401, 403, 200),
    "seeking": ("POST", "/api/playback", {"seek": 0}, 401, 403, 202),
    "opening": ("POST", "/api/source", {"uri": "test:car"}, 401, 403, 202),
    "exporting": ("POST", "/api/clip", {"first": 0, "last": 1, "kind": "csv"}, 401, 403, 404),
    "a mark by another spelling": ("POST", "/api/marks/", {"text": ""}, 401, 403, 405),
    "the fleet": ("GET", "/api/fleet", None, 401, 403, 200),
    "the drives of a fleet": ("GET", "/api/fleet/rows", None, 401, 403, 404),
    "viser": ("GET", "/viser/", None, 401, 403, 502),
    "rerun": ("GET", "/rerun/", None, 401, 200, 200),
}


@pytest.mark.parametrize("role", ["nobody", "display", "person"])
@pytest.mark.parametrize("name", DOORS)
def test_who_may_do_what(visitor: Visitor, name: str, role: str):
    method, path, body, *expected = DOORS[name]
    answer = visitor(role).request(method, path, json=body)
    assert answer.status_code == expected[["nobody", "display", "person"].index(role)]


def test_every_change_but_two_is_kept_from_a_display(app: FastAPI, visitor: Visitor):
    display, left = visitor("display"), set()
    for path, methods in app.openapi()["paths"].items():
        for method in methods:
            if method != "get" and display.request(method, path.replace("{number}", "1"), json={}).status_code != 403:
                left.add((method, path))
    assert left == {("post", "/api/marks"), ("post", "/api/recording")}


SOCKETS = {
    "nobody": ("/api/stream", "nobody", {}, False),
    "a display": ("/api/stream", "display", {}, True),
    "a person": ("/api/stream", "person", {}, True),
    "a display at viser": ("/viser", "display", {}, False),
    "nobody at viser": ("/viser", "nobody", {}, False),
    "a hostile page with the person's cookie": ("/api/stream", "person", {"origin": EVIL}, False),
    "a hostile page at viser": ("/viser", "person", {"origin": EVIL}, False),
    "a page from another port": ("/api/stream", "person", {"origin": "http://127.0.0.1:1"}, False),
    "a sandboxed page": ("/api/stream", "person", {"origin": "null"}, False),
}


@pytest.mark.parametrize("name", SOCKETS)
def test_who_gets_a_socket(address: str, name: str):
    path, role, headers, welcome = SOCKETS[name]
    token = getattr(TOKENS, role, None)
    cookie = {"cookie": f"cipv_token_{urlsplit(address).port}={token}"} if token else {}
    own = {"origin": address} | cookie | headers
    url = address.replace("http", "ws") + path
    if welcome:
        with connect(url, additional_headers=own, max_size=None, open_timeout=WAIT_S) as socket:
            assert socket.recv(WAIT_S)
    else:
        with pytest.raises(InvalidStatus, match="403"):
            connect(url, additional_headers=own, open_timeout=WAIT_S)


# ------------------------------------------------------------ the hostile page

FORMS = {
    "a form": ("application/x-www-form-urlencoded", b"playing=true"),
    "JSON that needs no preflight": ("text/plain", b'{"playing": true}'),
    "a file": (
        "multipart/form-data; boundary=x",
        b'--x\r\nContent-Disposition: form-data; name="a"\r\n\r\n1\r\n--x--\r\n',
    ),
}


@pytest.mark.parametrize("name", FORMS)
def test_a_hostile_page_changes_nothing_with_a_form(visitor: Visitor, engine: Engine, name: str):
    kind, body = FORMS[name]
    before = engine.control.peek()
    for origin in (EVIL, "null"):
        answer = visitor("person").post("/api/playback", content=body, headers={"content-type": kind, "origin": origin})
        assert answer.status_code == 403
    assert engine.control.peek() == before


HOSTS = {
    "an address of this machine": ("192.168.1.5:8420", True),
    "one of IPv6": ("[fd00::5]:8420", True),
    "loopback": ("127.0.0.1", True),
    "a rebound name": ("evil.example:8420", False),
    "a name that looks like an address": ("127.0.0.1.evil.example", False),
    "the wildcard, which browsers take for loopback": ("0.0.0.0:8420", True),
}


@pytest.mark.parametrize("name", HOSTS)
def test_names_can_be_rebound_and_addresses_cannot(address: str, name: str):
    host, known = HOSTS[name]
    headers = {"host": host, "authorization": f"Bearer {TOKENS.person}"}
    for path in ("/api/state", "/", "/rerun/"):
        assert (httpx.get(address + path, headers=headers, timeout=WAIT_S).status_code == 200) == known


# ------------------------------------------------------------ the path traverser

OUTSIDE = ["..%2f..%2fpyproject.toml", "%2e%2e/%2e%2e/pyproject.toml", "..%5c..%5cpyproject.toml", "%2fetc%2fpasswd"]


@pytest.mark.parametrize("outside", OUTSIDE)
def test_no_name_in_an_address_becomes_a_path(app: FastAPI, address: str, visitor: Visitor, outside: str):
    routes = [path for path, methods in app.openapi()["paths"].items() if "{" in path and "get" in methods]
    folders = ["/", "/js/", "/drive/", "/rerun/", "/viser/", "/css/"]
    assert "/api/jobs/{number}/file" in routes
    cookie = {"cookie": "; ".join(f"{k}={v}" for k, v in visitor("person").cookies.items())}
    connection = http.client.HTTPConnection(urlsplit(address).netloc, timeout=WAIT_S)
    for path in [route.replace(route[route.index("{") : route.index("}") + 1], outside) for route in routes] + [
        folder + outside for folder in folders
    ]:
        connection.request("GET", path, headers=cookie)
        answer = connection.getresponse()
        text = answer.read()
        assert answer.status in (400, 404, 422, 502), path
        assert b"[project]" not in text
        assert b"root:" not in text
    connection.close()


# ------------------------------------------------------------ the endless upload


def _resident_bytes() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096


ENDLESS = {
    # path, the most that is taken
    "parameters": ("/api/params", LARGEST_BODY),
    "a file of labels": (f"{IMPORT}?person=Ada&drive=any", LARGEST_FILE),
}


@pytest.mark.parametrize("name", ENDLESS)
def test_ten_gigabytes_in_pieces_are_cut_off(
    address: str, visitor: Visitor, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))  # where the server keeps what has come
    path, largest = ENDLESS[name]
    cookie = "; ".join(f"{k}={v}" for k, v in visitor("person").cookies.items())
    connection = http.client.HTTPConnection(urlsplit(address).netloc, timeout=WAIT_S)
    connection.putrequest("POST", path)
    for header, value in {"cookie": cookie, "content-type": "application/json", "transfer-encoding": "chunked"}.items():
        connection.putheader(header, value)
    connection.endheaders()
    block, sent, before = b" " * (1 << 20), 0, _resident_bytes()
    try:
        while sent < 10 << 30:
            connection.send(b"%x\r\n%b\r\n" % (len(block), block))
            sent += len(block)
    except OSError:
        pass  # the server has hung up
    connection.close()
    assert largest <= sent + len(block), "nothing that may come was cut off"
    assert sent < largest + (64 << 20), "cut off within what the system's buffers hold"
    assert _resident_bytes() - before < 64 << 20
    assert list(tmp_path.iterdir()) == [], "the outcome is discarded"
    assert visitor("person").get("/api/state").status_code == 200


@pytest.mark.parametrize("name", ENDLESS)
def test_a_length_beyond_the_limit_is_refused_before_a_byte_of_it(address: str, visitor: Visitor, name: str):
    path, largest = ENDLESS[name]
    cookie = "; ".join(f"{k}={v}" for k, v in visitor("person").cookies.items())
    for length in (str(10 << 30), str(largest + 1)):
        connection = http.client.HTTPConnection(urlsplit(address).netloc, timeout=WAIT_S)
        connection.request("POST", path, headers={"cookie": cookie, "content-length": length})
        answer = connection.getresponse()
        assert answer.status == 413
        assert f"larger than {largest >> 20} MiB" in answer.read().decode()
        connection.close()


def test_a_body_in_pieces_at_the_limit_is_read(visitor: Visitor):
    text = b'{"preset": "default"}'
    pieces = iter([text, b" " * (LARGEST_BODY - len(text))])
    headers = {"content-type": "application/json"}
    assert visitor("person").post("/api/params", content=pieces, headers=headers).status_code == 200
    over = iter([text, b" " * (LARGEST_BODY - len(text) + 1)])
    assert visitor("person").post("/api/params", content=over, headers=headers).status_code == 413


def test_a_message_beyond_the_limit_ends_its_socket_only(address: str):
    headers = {"origin": address, "authorization": f"Bearer {TOKENS.person}"}
    url = address.replace("http", "ws") + "/api/stream"
    with connect(url, additional_headers=headers, max_size=None, open_timeout=WAIT_S) as other:
        with connect(url, additional_headers=headers, max_size=None, open_timeout=WAIT_S) as socket:

            def shout() -> None:
                socket.send("x" * (2 << 20))
                deque(iter(lambda: socket.recv(WAIT_S), None), maxlen=0)

            with pytest.raises(ConnectionClosedError) as ended:
                shout()
            # a server that hangs up on unread bytes may cut its own last word off
            assert ended.value.rcvd is None or ended.value.rcvd.code == 1009
        other.send('{"ping": 1}')
        assert other.recv(WAIT_S)
