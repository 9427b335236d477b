"""Every parser of external data, each with valid inputs. Those of third-party files and of the program's own files are
in ``file_targets.py``, those of OpenSCENARIO files in ``scenario_targets.py``, those of batches, projects and accounts
in ``store_targets.py``."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from copy import deepcopy
from functools import lru_cache, partial
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import patch

import cv2
import numpy as np
from ruamel.yaml import YAML

from pipeline.common.files import image_decoding
from pipeline.common.files.image_decoding import decode_within_budget
from pipeline.common.files.user_file_errors import parse_yaml
from pipeline.formats.kitti_records import parse_timestamps
from pipeline.formats.nmea import NmeaReader
from pipeline.formats.velodyne.decoder import VelodyneDecoder
from pipeline.formats.velodyne.models import HDL32E, VLP16, VLP32C, VelodyneModel
from pipeline.labels.formats.native import from_json, to_json
from pipeline.labels.model import LabelSet
from pipeline.recording.info import info
from pipeline.recording.neighbours import EarlierFile
from pipeline.recording.rewrite import recover
from pipeline.recording.session.frame_record import frame_record_from
from pipeline.recording.session.source import SessionSource
from pipeline.recording.session.writer import SessionWriter
from pipeline.simulation import scenario
from pipeline.sources import open_source
from pipeline.sources.kitti import hdl64_rings
from pipeline.sources.kitti import source as kitti_source
from pipeline.sources.live import config
from pipeline.sources.live.devices.can import load_dbc
from pipeline.sources.route_files import load_route
from tests.fuzz.file_targets import by_file, file_targets
from tests.fuzz.scenario_targets import scenario_targets
from tests.fuzz.store_targets import store_targets
from tests.fuzz.target import Target
from tests.pipeline.formats.velodyne.streams import drive
from tests.pipeline.formats.velodyne.test_models import stream
from tests.pipeline.recording.frames import ABOUT, TRUTH, full, write
from tests.pipeline.sources.live.devices.test_wires import DBC
from tests.pipeline.sources.made.bags import Kind, write_bag, write_packet_bag
from tests.pipeline.sources.test_fuzz import FILES
from tests.pipeline.sources.test_route_files import GGA, GPX, POINTS, RMC

_MOST_FRAMES = 3
_ABOVE_ALL = 2.0
"""Weight of sessions and bags, which can be damaged in most ways."""


def _sentences(data: bytes) -> None:
    reader = NmeaReader()
    for line in data.splitlines():
        reader.push(line.decode("ascii", "replace"), 1_700_000_000_000_000_000)
    reader.flush(1_700_000_000_000_000_000)


def _packets(data: bytes, model: VelodyneModel = VLP16) -> None:
    decoder = VelodyneDecoder(model=model)
    for at in range(0, len(data), 1206):
        decoder.push(data[at : at + 1206], None)


def _frames_of(uri: str) -> None:
    source = open_source(uri)
    for index in range(min(len(source), _MOST_FRAMES)):
        source.frame(index)
        source.truth(index)


def _frames_of_bag(path: str) -> None:
    _frames_of(f"rosbag:{path}")


def _whole_recording(uri: str, _: str) -> None:
    """Read a whole recording, one of whose files was replaced."""
    _frames_of(uri)


def _text(read: Callable[[str, str], object]) -> Callable[[bytes], object]:
    return lambda data: read(data.decode("utf-8", "replace"), "x")


def _route(place: str) -> bytes:
    return GPX.format(1, 1, f"<trk><trkseg>{POINTS.format(place)}</trkseg></trk>").encode()


def _bag(folder: Path, kind: Kind) -> bytes:
    return write_bag(folder / "one.bag", kind, 2, every=50).read_bytes()


def _many_chunks(folder: Path) -> bytes:
    """A session with one chunk per frame, a hash chain, labels, and files before and after it."""
    path = folder / f"chunks{len(list(folder.iterdir()))}.mcap"
    writer = SessionWriter(path, ABOUT, compression="lz4", follows=EarlierFile("whole.mcap", "0" * 64))
    for index in range(4):
        writer.write(full(index), truth=TRUTH)
        writer.flush()
    writer.write_labels(to_json(LabelSet("a", ("000000",), (100_000_000,))))
    writer.write_mark("here")
    writer.close(continues_in="whole.mcap")
    return path.read_bytes()


def _everything_of_session(path: str) -> None:
    info(Path(path))
    session = SessionSource("a", path)
    try:
        for index in range(min(len(session), _MOST_FRAMES)):
            session.frame(index), session.result(index), session.params(index)
        session.marks(), session.labels(), session.fixes()
        for _ in session.outlines():
            pass
    finally:
        session.close()


def _recovered(path: str) -> None:
    out = Path(path + ".whole")
    out.unlink(missing_ok=True)
    recover(Path(path), out)


def targets(folder: Path) -> dict[str, Target]:
    """All targets. Those that read files write them below ``folder``."""
    grey = np.full((24, 40, 3), 90, np.uint8)
    images = tuple(cv2.imencode(suffix, grey)[1].tobytes() for suffix in (".png", ".jpg"))
    built_in = tuple(path.read_bytes() for path in sorted(scenario.FOLDER.glob("*.yaml"))[:3])
    session = write(folder / "whole.mcap", [full(index) for index in range(3)])
    found = {
        "image": Target(images, decode_within_budget),
        "nmea": Target(((GGA + RMC).encode(),), _sentences),
        "velodyne": Target((b"".join(packet for packet, _ in drive(1)[:8]),), _packets),
        **{
            f"velodyne {model.name}": Target(
                (b"".join(packet for packet, _ in stream(model, 1)[:8]),), partial(_packets, model=model)
            )
            for model in (HDL32E, VLP32C)
        },
        "yaml": Target((b"a: &a [1, 2]\nb: {c: *a, d: 2026-01-01}\n", *built_in), _text(parse_yaml)),
        "scenario": Target(built_in, _text(scenario.parse)),
        "labels": Target((to_json(LabelSet("a", ("1", "2"), (0, 1))),), lambda data: from_json(data, "x")),
        "frame record": Target((b'{"index": 1, "name": "a", "t_ns": 5}',), frame_record_from),
        "kitti stamps": Target((b"2011-09-26 13:02:25.964389445\n" * 3,), parse_timestamps),
        "gpx": Target((_route("trkpt"),), by_file(folder, "a.gpx", load_route)),
        "route csv": Target((b"lat,lon\n48.1,11.2\n48.2,11.3\n",), by_file(folder, "a.csv", load_route)),
        "dbc": Target((DBC.encode(),), by_file(folder, "a.dbc", lambda path: load_dbc(Path(path)))),
        "live config": Target((b"title: a\nlidar: {data_port: 2368}\n",), by_file(folder, "a.yaml", config.load)),
        "session": Target((session.read_bytes(),), by_file(folder, "a.mcap", _frames_of), _ABOVE_ALL),
        "session in chunks": Target(
            (_many_chunks(folder),), by_file(folder, "b.mcap", _everything_of_session), _ABOVE_ALL
        ),
        "session cut off": Target((_many_chunks(folder)[:40_000],), by_file(folder, "c.mcap", _recovered), _ABOVE_ALL),
        "ros 1 bag": Target((_bag(folder, "ros1"),), by_file(folder, "ros.bag", _frames_of_bag), _ABOVE_ALL),
        "ros 1 bag of packets": Target(
            (write_packet_bag(folder / "packets.bag", "ros1", 2).read_bytes(),),
            by_file(folder, "p.bag", _frames_of_bag),
            _ABOVE_ALL,
        ),
    }
    found |= file_targets(folder / "files") | scenario_targets(folder / "scenarios") | store_targets(folder / "stores")
    for name, (make, uri, inside) in FILES.items():
        (folder / name).mkdir()
        recording = make(folder / name / "recording")
        path = recording / inside
        reading = by_file(path.parent, path.name, partial(_whole_recording, uri.format(folder=recording)))
        found[f"file of {name}"] = Target((path.read_bytes(),), reading, _ABOVE_ALL if "rosbag" in name else 1.0)
    return found


@contextmanager
def _undamaged_files_read_once() -> Iterator[None]:
    """Cache undamaged files, since reading a recording's other images, sweeps and descriptions would take most of the
    time."""
    decode, elevations, load = cv2.imdecode, hdl64_rings.ring_elevations_deg, YAML.load

    @lru_cache(maxsize=64)
    def decoded(data: bytes, flags: int) -> object:
        return decode(np.frombuffer(data, np.uint8), flags)

    @lru_cache(maxsize=64)
    def fitted(points: bytes, turn: bytes, count: int) -> object:
        return elevations(np.frombuffer(points, np.float32).reshape(-1, 4), np.frombuffer(turn, np.int64), count)

    @lru_cache(maxsize=64)
    def described(text: str) -> object:
        return load(YAML(typ="safe"), text)

    fast = SimpleNamespace(**vars(cv2) | {"imdecode": lambda data, flags: decoded(data.tobytes(), flags)})
    by_content = lambda points, turn, count: fitted(points.tobytes(), turn.tobytes(), count)  # noqa: E731
    with (
        patch.object(image_decoding, "cv2", fast),
        patch.object(kitti_source, "ring_elevations_deg", by_content),
        patch.object(YAML, "load", lambda _, text: deepcopy(described(text))),  # of bags
    ):
        yield


def all_targets() -> Iterator[dict[str, Target]]:
    """All targets; their folder, in memory if possible, is removed at the end."""
    memory = Path("/dev/shm")
    with (
        tempfile.TemporaryDirectory(prefix="cipv-fuzz-", dir=memory if memory.is_dir() else None) as folder,
        _undamaged_files_read_once(),
        suppress(KeyboardInterrupt),
    ):
        known = targets(Path(folder))
        for target in known.values():
            target.read(target.seeds[0])  # compilation does not count as the parser's time
        yield known
