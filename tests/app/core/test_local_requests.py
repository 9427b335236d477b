"""Servers on this machine are reached past any proxy."""

from __future__ import annotations

import ast
import threading
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path

import pytest

from app.core.local_requests import open_local

ROOT = Path(__file__).resolve().parents[3]


def test_a_proxy_is_not_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    class Hello(BaseHTTPRequestHandler):
        def do_GET(self) -> None:  # the name that http.server calls
            self.send_response(200)
            self.end_headers()
            self.wfile.write(b"hello")

    for name in ("http_proxy", "HTTP_PROXY", "all_proxy"):
        monkeypatch.setenv(name, "http://127.0.0.1:9")  # nobody listens there
    with HTTPServer(("127.0.0.1", 0), Hello) as server:
        answering = threading.Thread(target=server.handle_request)
        answering.start()
        with open_local(f"http://127.0.0.1:{server.server_port}/") as answer:
            assert answer.read() == b"hello"
        answering.join()


def test_nothing_in_the_program_reaches_this_machine_another_way() -> None:
    """Both libraries ask the environment for a proxy unless told otherwise."""
    wrong = []
    for file in (ROOT / "app").rglob("*.py"):
        text = file.read_text(encoding="utf-8")
        calls = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Call)]
        named = [(getattr(call.func, "id", getattr(call.func, "attr", "")), call) for call in calls]
        if "websockets" in text and ".client import" in text:
            wrong += [
                f"{file.name}:{call.lineno} connect without proxy=None"
                for name, call in named
                if name == "connect" and not any(word.arg == "proxy" for word in call.keywords)
            ]
        wrong += [f"{file.name}:{call.lineno} urlopen" for name, call in named if name == "urlopen"]
    assert wrong == []
