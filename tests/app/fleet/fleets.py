"""A small fleet of sessions, batches of it in this process and on Dask, and what is compared of them."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2

from app.fleet.batch.addresses import recordings
from app.fleet.batch.job import Job
from app.fleet.batch.keys import RunKey, code_digest, networks_digest
from app.fleet.batch.plan import Plan, PlannedWork, begin, work_of
from app.fleet.batch.tables import TIMINGS
from app.fleet.store import Store
from pipeline.common.files.image_decoding import decode_within_budget
from pipeline.detection import DetectorChoice
from pipeline.params import Params
from pipeline.recording.save import save
from pipeline.sources import open_source
from pipeline.types import CameraImage, Frame
from pipeline.types.source import Source

CHOICE = DetectorChoice(lanes="off", far_px=None)
DRIVES = {"near": ("sim:cut_in", 60, 67), "far": ("sim:straight", 0, 7), "left": ("sim:cut_out", 40, 47)}
"""Name → scenario, first and last frame."""
COPIES, LENGTH = 2, 8
SESSIONS = COPIES * len(DRIVES)
BAD = "torn.mcap"


class _Filmed:
    """Images of the simulator as a camera sends them, as JPEG: a batch decodes a PNG for longer than it processes it,
    and it takes six times as many bytes."""

    def __init__(self, source: Source) -> None:
        self._source = source

    def __getattr__(self, name: str) -> Any:
        return getattr(self._source, name)

    def __len__(self) -> int:
        return len(self._source)

    def frame(self, index: int) -> Frame:
        frame = self._source.frame(index)
        assert frame.image is not None
        jpeg = cv2.imencode(".jpg", frame.image.bgr)[1].tobytes()
        pixels = decode_within_budget(jpeg)
        assert pixels is not None
        return replace(frame, image=CameraImage(frame.image.t_ns, pixels, jpeg))


def make_fleet(folder: Path, copies: int = 1) -> Path:
    """Sessions of eight frames, ``copies`` of each drive, and one file that is not a session."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, (uri, first, last) in DRIVES.items():
        save(_Filmed(open_source(uri)), folder / f"{name}-0.mcap", first, last)  # type: ignore[arg-type]
        for number in range(1, copies):
            (folder / f"{name}-{number}.mcap").write_bytes((folder / f"{name}-0.mcap").read_bytes())
    (folder / BAD).write_bytes(b"\x89MCAP0\r\n" + bytes(200))
    return folder


def plan_of(*addresses: object, params: Params | None = None, sensors: str = "both", results: bool = False) -> Plan:
    """A batch of these addresses."""
    return Plan(tuple(map(str, addresses)), params or Params(), CHOICE, sensors, 16, results)  # type: ignore[arg-type]


def begun(plan: Plan, out: object) -> PlannedWork:
    """The jobs of a batch after its plan was written."""
    store = Store(str(out))
    work = work_of(plan, store)
    begin(plan, work, store)
    return work


def job_of(address: str, out: object, **more: object) -> Job:
    """One drive, as a batch with the default parameters would run it."""
    key = RunKey(code_digest(), networks_digest(CHOICE), Params(), "both", 16)
    (recording,) = recordings([address])
    return Job(recording, key, CHOICE, Store(str(out)), **more)  # type: ignore[arg-type]


def contents(out: object) -> dict[str, str]:
    """Name → SHA-256 of every file of a batch that is reproducible: all except timings and files that contain the
    folder's path."""
    store = Store(str(out))
    names = [name for name in store.names("") if f"/{TIMINGS.name}/" not in name and name != "batch.json"]
    return {name: hashlib.sha256(store.read(name) or b"").hexdigest() for name in names}
