"""Files of batches, projects and accounts, and what is typed or sent as text."""

from __future__ import annotations

import asyncio
import bz2
import json
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
from fastapi import Request

from app.drive.events import event_kinds
from app.fleet.batch.answers import packed, unpacked
from app.fleet.batch.plan import Plan
from app.fleet.compare.gate import read_rules
from app.fleet.pack_index import Pack, keep_index, packs_of
from app.fleet.runs import about_run, latest_run, make_latest, set_aside
from app.fleet.store import Store
from app.fleet.sweep import parse_axis
from app.labels.projects.project_file import read_project
from app.web.guards.accounts import add_account, read_accounts
from app.web.guards.own_name import _in_body
from pipeline.detection import DetectorChoice
from pipeline.labels.classes import FILE as CLASSES
from pipeline.labels.classes import parse_classes
from pipeline.params import Params
from pipeline.recording.session.source import _params_from
from pipeline.sources.pcap.capture import Capture
from pipeline.sources.rosbag.unpack_budget import bounded
from pipeline.types import RawLanes
from tests.fuzz.target import Target
from tests.pipeline.sources.made.captures import write_capture

_RUN = "a"


def store_targets(folder: Path) -> dict[str, Target]:
    """All targets of this module. Their files are written below ``folder``, which is created."""
    folder.mkdir()
    lanes = RawLanes("b", np.zeros((2, 2), np.float32), np.ones(1, np.float32), np.zeros(2, np.int32))
    params = json.dumps(Params().model_dump(mode="json")).encode()
    return {
        **_of_batches(folder / "batch"),
        **_of_people(folder / "people"),
        "detections of a batch": Target((packed({(0, "b"): lanes}),), unpacked),
        "axis of a sweep": Target((b"cluster.tolerance_m=0.4,0.6", b"cluster.tolerance_m=0:1:5"), _text(parse_axis)),
        "class list": Target((CLASSES.read_bytes(),), _text(lambda text: _parse_classes(text, "x"))),
        "parameters of a session": Target((params,), _params),
        "beginnings of packets": Target(_captured(folder / "captured"), _beginnings(folder / "a.pcap")),
        "chunk of a bag": Target((bz2.compress(b"abc" * 100),), _chunk),
        "body of a request": Target((b'{"person": "Ada"}',), _body),
    }


# Without its cache: a text that was parsed before in this process is parsed again
_parse_classes = parse_classes.__wrapped__


def _text(read: Callable[[str], object]) -> Callable[[bytes], object]:
    return lambda data: read(data.decode("utf-8", "replace"))


def _of_batches(folder: Path) -> dict[str, Target]:
    store = Store(str(folder))
    make_latest(store, _RUN)
    keep_index(store, _RUN, Pack(0, {"drive": "mark"}))
    Plan(("sim:straight",), Params(), DetectorChoice()).save(store)
    about = {"code": "c", "networks": "n", "sensors": "both", "rings": 16, "params": {"cluster": {"z_weight": 0.5}}}
    store.write(f"runs/{_RUN}.json", json.dumps(about).encode())
    store.write(f"aside/run={_RUN}/drive.json", json.dumps({"address": "x", "reason": "y", "mark": "z"}).encode())
    (folder / "rules.yaml").write_text(
        f"rules:\n- {{event: {min(event_kinds())}, more_by_at_most: 3}}\n", encoding="utf-8"
    )
    readers: dict[str, Callable[[], object]] = {
        "latest.json": lambda: latest_run(store),
        f"packed/run={_RUN}.json": lambda: packs_of(store, _RUN),
        "batch.json": lambda: Plan.load(store),
        f"runs/{_RUN}.json": lambda: about_run(store, _RUN),
        f"aside/run={_RUN}/drive.json": lambda: set_aside(store, _RUN),
        "rules.yaml": lambda: read_rules(folder / "rules.yaml"),
    }
    return {
        f"batch {name.partition('/')[0]}": Target(((folder / name).read_bytes(),), _replaced(folder / name, read))
        for name, read in readers.items()
    }


def _of_people(folder: Path) -> dict[str, Target]:
    folder.mkdir()
    accounts, project = folder / "accounts.json", folder / "project.yaml"
    add_account("Ada", "labeler", accounts)
    project.write_text("name: a\ndrives: [sim:straight]\n", encoding="utf-8")
    return {
        "accounts": Target((accounts.read_bytes(),), _replaced(accounts, lambda: read_accounts(accounts))),
        "project": Target((project.read_bytes(),), _replaced(project, lambda: read_project(project))),
    }


def _replaced(path: Path, read: Callable[[], object]) -> Callable[[bytes], None]:
    def reading(data: bytes) -> None:
        path.write_bytes(data)
        read()

    return reading


def _captured(folder: Path) -> tuple[bytes, ...]:
    write_capture(folder)
    return ((folder / "drive.pcap").read_bytes(),)


def _params(data: bytes) -> None:
    with suppress(AttributeError):  # the session treats it as no parameters, as it does a refusal
        _params_from(data)


def _chunk(data: bytes) -> None:
    with suppress(OSError, EOFError):  # of the library; a bag that raises anything is refused
        bounded(bz2.BZ2Decompressor)(data)


def _beginnings(path: Path) -> Callable[[bytes], None]:
    def reading(data: bytes) -> None:
        path.write_bytes(data)
        for _ in Capture(path).beginnings():
            pass

    return reading


def _body(data: bytes) -> None:
    async def body() -> bytes:
        return data

    asyncio.run(_in_body(cast(Request, SimpleNamespace(body=body))))
