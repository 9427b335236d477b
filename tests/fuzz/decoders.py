"""Which functions of the product decode bytes or text, and which of them ran: what the fuzzer must cover."""

from __future__ import annotations

import ast
import sys
import threading
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from types import CodeType, FrameType

from tests.conftest import ROOT

_DECODES = {
    "json": {"loads", "load"},
    "msgpack": {"decode"},
    "ElementTree": {"fromstring"},
    "np": {"frombuffer", "fromfile", "load", "loadtxt", "genfromtxt"},
    "csv": {"reader", "DictReader"},
    "zlib": {"decompress"},
    "zipfile": {"ZipFile"},
    "cv2": {"imdecode"},
    "av": {"open"},
    "yaml": {"load", "safe_load"},
    "pynmea2": {"parse"},
}
"""Functions that decode, by the name of their module."""
_ALWAYS = {"unpack_from", "iter_unpack", "parse_yaml", "read_yaml", "parse_xml", "validate_json", "decompress"}
"""Methods and functions that decode, whatever they are called on."""
_FOLDERS = ("pipeline", "app")
_TOOLS = ("app/bench", "pipeline/training", "pipeline/experiments")
"""Measure and train, with data that they made themselves."""


@cache
def decoders() -> frozenset[str]:
    """``file:function`` of every function that decodes."""
    files = (path for folder in _FOLDERS for path in sorted((ROOT / folder).rglob("*.py")))
    return frozenset(
        f"{path}:{function}"
        for path, file in ((str(file.relative_to(ROOT)), file) for file in files)
        if not path.startswith(_TOOLS)
        for function in _in(ast.parse(file.read_text(encoding="utf-8")), ())
    )


def ran(call: Callable[[], object]) -> set[str]:
    """``file:function`` of every function of the product that a call runs, in any thread that begins with it."""
    codes: set[CodeType] = set()

    def note(frame: FrameType, event: str, _: object) -> None:
        if event == "call":
            codes.add(frame.f_code)

    threading.setprofile(note)
    sys.setprofile(note)
    try:
        call()
    finally:
        sys.setprofile(None)
        threading.setprofile(None)  # type: ignore[arg-type]
    return {
        f"{Path(code.co_filename).relative_to(ROOT)}:{code.co_qualname.replace('.<locals>', '')}"
        for code in codes
        if code.co_filename.startswith(tuple(f"{ROOT}/{folder}/" for folder in _FOLDERS))
    }


def _in(node: ast.AST, within: tuple[str, ...]) -> Iterator[str]:
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield from _in(child, (*within, child.name))
            continue
        if isinstance(child, ast.Call) and _is_decoding(child):
            yield ".".join(within)
        yield from _in(child, within)


def _is_decoding(call: ast.Call) -> bool:
    match call.func:
        case ast.Attribute(value=value, attr=name):
            module = value.attr if isinstance(value, ast.Attribute) else getattr(value, "id", "")
            writes = any(isinstance(each, ast.Constant) and each.value in ("w", "a") for each in call.args)
            return (name in _ALWAYS or name in _DECODES.get(module, ())) and not writes
        case ast.Name(id=name):
            return name in _ALWAYS
    return False
