"""Parsers of third-party files, of the program's own files, and of data from cameras and pages."""

from __future__ import annotations

import http.client
import io
import json
import os
import shutil
import zipfile
from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from itertools import count, islice
from pathlib import Path
from unittest.mock import patch

import cv2
import numpy as np

from app.core.shared_view_state import SharedViewState
from app.drive.alignment_versions import AlignmentVersions
from app.drive.marks import Marks
from app.labels.transfer.files import _unzipped
from app.streaming.scene_requests import hear
from app.streaming.stream import _object
from pipeline.common.files.image_decoding import check_budget
from pipeline.detection import Detectors
from pipeline.evaluation.scores.results_file import read_results
from pipeline.formats.calibration_files import FORMATS as CALIBRATIONS
from pipeline.inference import model_registry, used_files
from pipeline.inference.distance_laws import find_law, law_file
from pipeline.inference.runtime import open_session, read_graph
from pipeline.inference.tuning import _key, kept_way, untuned
from pipeline.labels.classes import FILE as CLASSES
from pipeline.labels.classes import read_classes
from pipeline.labels.formats.registry import FORMATS as LABELS
from pipeline.labels.formats.registry import export_labels, import_labels
from pipeline.params import Params, from_yaml, to_yaml
from pipeline.replay import faults
from pipeline.run import run
from pipeline.sources import open_source
from pipeline.sources.live.devices.device_reader import ReaderStop
from pipeline.sources.live.devices.mjpeg import read_mjpeg
from pipeline.types.detections import DistanceLaw
from pipeline.types.result_json import to_line
from tests.fuzz.target import Target
from tests.pipeline.calibration.alignment.made_drive import CAMERA
from tests.pipeline.labels.formats.sets import IMPORT, drive
from tests.pipeline.labels.formats.test_round_trip import full_set
from tests.pipeline.sources.conftest import object_calibration, write_kitti, write_kitti_raw
from tests.pipeline.sources.live.devices.test_mjpeg import MULTIPART, part
from tests.pipeline.sources.made.captures import RIG, lidar, pcapng, write_video
from tests.pipeline.vision.networks import yolox

_PART_OF_MANY = 0.25
"""Weight of one of many files of a format."""
_PARTS = 6
"""Number of images that a camera sends, after which it is not read any more."""


def by_file(folder: Path, name: str, read: Callable[[str], object]) -> Callable[[bytes], None]:
    """A parser of bytes that writes them to a file and calls ``read`` with its path."""
    path = folder / name

    def reading(data: bytes) -> None:
        path.write_bytes(data)
        read(str(path))

    return reading


def file_targets(folder: Path) -> dict[str, Target]:
    """All targets of this module. Their files are written below ``folder``, which is created."""
    folder.mkdir()
    return {
        **_labels(folder / "labels"),
        **_calibrations(folder / "calibrations"),
        **_own_files(folder / "own"),
        **_recordings(folder / "recordings"),
        "mjpeg": Target((_mjpeg(),), _camera),
        "message of a page": Target(
            (b'{"held": {"track": 1}, "selected": 3, "labels_3d": [], "page_3d": "a"}',),
            lambda data: hear(SharedViewState(), object(), _object(data.decode("utf-8", "replace"))),
        ),
    }


def _labels(folder: Path) -> dict[str, Target]:
    here, found = drive(), {}
    for name in LABELS.keys() - {"mcap", "native"}:
        whole = folder / name
        whole.parent.mkdir(exist_ok=True)
        export_labels(full_set(), here, name, whole)
        read = lambda _, whole=whole, name=name: import_labels(whole, here, name, IMPORT)  # noqa: E731
        files = sorted(path for path in whole.rglob("*") if path.is_file() and path.stat().st_size) or [whole]
        for path in files:
            inside = f" {path.name}" if whole.is_dir() else ""
            weight = _PART_OF_MANY if len(files) > 1 else 1.0
            found[f"labels {name}{inside}"] = Target(
                (path.read_bytes(),), by_file(path.parent, path.name, read), weight
            )
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as made:
        made.writestr("labels/a.txt", "x" * 300)
    found["labels in a zip"] = Target(
        (packed.getvalue(),), by_file(folder, "a.zip", partial(_unpacked, folder / "out"))
    )
    return found


def _unpacked(out: Path, path: str) -> None:
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir()
    _unzipped(Path(path), out)


def _calibrations(folder: Path) -> dict[str, Target]:
    found, size = {}, (CAMERA.width, CAMERA.height)
    for name, kind in CALIBRATIONS.items():
        if kind.parse is None:
            continue
        path = folder / name / "a.yaml"
        path.parent.mkdir(parents=True)
        kind.write(path, CAMERA)
        for file in [path] if path.is_file() else sorted(path.iterdir()):
            reading = by_file(file.parent, file.name, lambda _, path=path, kind=kind: kind.read(path, size))
            inside = f" {file.name}" if path.is_dir() else ""
            found[f"calibration {name}{inside}"] = Target((file.read_bytes(),), reading)
    day, read = folder / "day", CALIBRATIONS["kitti"].read
    write_kitti_raw(day)
    for file in (day / name for name in CALIBRATIONS["kitti"].names):
        reading = by_file(day, file.name, lambda _: read(day, None))
        found[f"calibration kitti {file.name}"] = Target((file.read_bytes(),), reading)
    return found


def _own_files(folder: Path) -> dict[str, Target]:
    """Files that the program stores beside recordings and networks, and files that users write for it."""
    store = folder / "home" / "models"
    store.mkdir(parents=True)
    network = yolox(folder / "a.onnx")
    with patch.dict(os.environ, CIPV_HOME=str(store.parent)):
        registry = _json({"defaults": {"detector": "a"}, "models": {"a": {"task": "detector", "sha256": "b"}}})
        tuned = _json({_key(network): asdict(untuned(2))})
    used = _json({"/a.onnx": dict.fromkeys(("sha256", "since", "until", "before"), "a")})
    law = _json({"law": asdict(DistanceLaw(1000.0, -1.0, 700.0, 1.5, 1.6, 0.8)), "network_sha256": "a"})
    marks = _json({"marks": [{"id": 1, "index": 2, "text": "a", "t_ns": 5, "in_session": True}]})
    rest = {"saved_at": "a", "drive": "b", "note": "", "match": 0.5, "iou": None}
    alignments = _json([{"id": 1, "values": {}, **rest}])
    marked = Marks(folder)._file("a")
    assert marked is not None

    def of_store(name: str, read: Callable[[], object]) -> Callable[[bytes], None]:
        def reading(_: str) -> None:
            with patch.dict(os.environ, CIPV_HOME=str(store.parent)):
                read()

        return by_file(store, name, reading)

    def of_file(name: str, read: Callable[[Path], object]) -> Callable[[bytes], None]:
        def reading(path: str) -> None:
            try:
                read(Path(path))
            finally:
                for aside in folder.glob("*.damaged*"):
                    aside.unlink()

        return by_file(folder, name, reading)

    return {
        "network": Target((network.read_bytes(),), of_file("b.onnx", _network)),
        "law of a network": Target((law,), of_file(law_file(network).name, lambda _: find_law(network))),
        "registry of networks": Target((registry,), of_store("registry.json", model_registry.list_models)),
        "used networks": Target((used,), of_store("used.json", used_files._read)),
        "tuning of networks": Target((tuned,), of_store("tuning.json", lambda: kept_way(network, 2))),
        "marks": Target((marks,), of_file(marked.name, lambda path: Marks(path.parent).of("a"))),
        "alignments": Target((alignments,), of_file("alignments.json", AlignmentVersions)),
        "parameters": Target((to_yaml(Params()).encode(),), of_file("p.yaml", lambda path: from_yaml(path, Params()))),
        "classes": Target((CLASSES.read_bytes(),), of_file("c.yaml", read_classes)),
        "faults": Target((b"- {sensor: lidar, kind: silence, from_s: 1, to_s: 2}\n",), of_file("f.yaml", faults.load)),
        "results": Target((_results(),), of_file("r.jsonl", read_results)),
    }


def _json(value: object) -> bytes:
    return json.dumps(value).encode()


def _network(path: Path) -> None:
    open_session(read_graph(path).SerializeToString(), path, 1)


def _results() -> bytes:
    """The results of two frames."""
    found = islice(run(open_source("sim:straight"), Params(), Detectors()), 2)
    return b"".join(to_line(result).encode() + b"\n" for _, result in found)


def _recordings(folder: Path) -> dict[str, Target]:
    """Files of recordings that are missing in ``FILES`` of the sources' own test."""
    folder.mkdir()
    (folder / "a.yaml").write_text(RIG)
    write_video(folder / "b.avi", 6)
    sequence = _kitti_sequence(folder)
    found = {
        "pcapng": Target((pcapng(lidar(2)),), _damaged(folder / "a.pcapng", f"pcap:{folder / 'a.pcapng'}")),
        "video alone": Target(((folder / "b.avi").read_bytes(),), _damaged(folder / "b.avi", str(folder / "b.avi"))),
    }
    for name in ("times.txt", "poses.txt", "calib.txt"):
        path = sequence / name
        found[f"kitti sequence {name}"] = Target((path.read_bytes(),), _damaged(path, f"kitti:{sequence}"))
    return found


def _damaged(path: Path, uri: str) -> Callable[[bytes], None]:
    def reading(_: str) -> None:
        source = open_source(uri)
        for index in range(min(len(source), 2)):
            source.frame(index)

    return by_file(path.parent, path.name, reading)


def _kitti_sequence(folder: Path) -> Path:
    made = write_kitti(folder / "object")
    sequence = folder / "sequences" / "04"
    shutil.copytree(made / "velodyne", sequence / "velodyne")
    shutil.copytree(made / "image_02", sequence / "image_2")
    calibration = object_calibration().replace("Tr_velo_to_cam", "Tr")
    (sequence / "calib.txt").write_text(calibration)
    (sequence / "times.txt").write_text("".join(f"{0.1 * k:e}\n" for k in range(3)))
    (sequence / "poses.txt").write_text("".join(f"1 0 0 0 0 1 0 0 0 0 1 {k}\n" for k in range(3)))
    return sequence


def _mjpeg() -> bytes:
    jpeg = cv2.imencode(".jpg", np.full((24, 40, 3), 90, np.uint8))[1].tobytes()
    parts = (part(jpeg, f"Content-Length: {len(jpeg)}", "X-Timestamp: 1700000000.5"), part(jpeg))
    return MULTIPART + b"".join(parts) * (_PARTS // len(parts))


class _Wire:
    """A connected socket that sends the given data and ignores what it receives."""

    def __init__(self, data: bytes) -> None:
        self.data = data

    def settimeout(self, seconds: float) -> None: ...

    def sendall(self, data: bytes) -> None: ...

    def close(self) -> None: ...

    def makefile(self, *_: object) -> io.BytesIO:
        return io.BytesIO(self.data)


def _camera(data: bytes) -> None:
    stop, taken = ReaderStop(), count(1)

    def take(jpeg: bytes, stamp_us: int | None) -> None:
        check_budget(jpeg)
        if next(taken) == _PARTS:
            stop.set()

    connection = http.client.HTTPConnection("camera")
    connection.connect = lambda: setattr(connection, "sock", _Wire(data))  # type: ignore[method-assign]
    with patch("pipeline.sources.live.devices.mjpeg._connection", lambda url: connection):
        read_mjpeg("http://camera/", take, stop)
