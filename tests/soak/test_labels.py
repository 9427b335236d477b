"""Labels, long: a hundred kills of the server while somebody labels, and a drive of 100,000 labels. Times are of this
process's CPU: what else the machine does is not counted, nor what a database server does."""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import pytest

from app.labels.acts.bulk import importing
from app.labels.acts.registry import do
from app.labels.acts.requests import SetSighting
from app.labels.acts.scope import Scope
from app.labels.service.answers import changes_json, window_json
from app.labels.store.database import Database
from app.labels.store.drive_labels import DriveLabels
from pipeline.common.geometry import Cuboid
from pipeline.evaluation.lead_verdict import LeadRule
from pipeline.evaluation.scores.truth import of_labels
from pipeline.labels.formats.base import FrameInfo, LabeledDrive, drive_of
from pipeline.labels.formats.registry import FORMATS, export_labels
from pipeline.labels.model import LabelSet, LabelTrack, LeadRange, Origin, Sighting
from pipeline.recording.session.provenance import About
from pipeline.recording.session.writer import SessionWriter
from pipeline.sources import open_source
from tests.app.labels.conftest import info, postgres_server, postgres_url  # noqa: F401
from tests.app.labels.kills import kill_again_and_again

pytestmark = pytest.mark.soak

KILLS = 100
FRAMES, TRACKS, LIFE = 4000, 1000, 100
SEEK_S, EXPORT_S = 0.15, 10.0
"""Limits of an export as a whole command, from its first import to its end."""
COUNTING_S = 15.0
"""nuScenes: points are counted by two threads, so that the command takes less time than CPU."""
BY = Origin("import", "made up", 1)
REPORT = Path("build/soak_labels.json")


@pytest.mark.timeout(3600)
def test_what_was_answered_as_saved_survives_a_hundred_kills(tmp_path: Path) -> None:
    answered, lost = kill_again_and_again(tmp_path / "labels.db", KILLS, seed=int(time.time()))
    _report(kills=KILLS, acts_answered=answered, acts_lost=lost)
    assert answered >= KILLS
    assert lost == 0


def many() -> LabelSet:
    """1,000 vehicles of 100 frames each: 100,000 labels."""
    names = tuple(f"{index:06d}" for index in range(FRAMES))
    tracks = []
    for number in range(1, TRACKS + 1):
        first = number * 37 % (FRAMES - LIFE)
        sightings = tuple(
            Sighting(
                f, Cuboid((5.0 + f % 50, number % 9 - 4.0, 0.7), (4.0, 1.8, 1.5), 0.01 * (f % 7)), None, f % 10 == 0
            )
            for f in range(first, first + LIFE)
        )
        tracks.append(LabelTrack(number, "car", sightings, "accepted", BY))
    leads = tuple(LeadRange(f, f + 9, 1 + f // 10, "accepted", BY) for f in range(0, FRAMES, 10))
    t_ns = tuple(index * 100_000_000 for index in range(FRAMES))
    return LabelSet("test:many", names, t_ns, tuple(tracks), leads)


@pytest.mark.timeout(3600)
@pytest.mark.parametrize("kind", ["sqlite", "postgres"])
def test_a_hundred_thousand_labels_in_one_drive(kind: str, request: pytest.FixtureRequest, tmp_path: Path) -> None:
    database = (
        Database.in_file(tmp_path / "labels.db")
        if kind == "sqlite"
        else Database(request.getfixturevalue("postgres_url"))
    )
    labels = DriveLabels(database, info("many", FRAMES))
    took: dict[str, float] = {}

    def timed(what: str, work: Any) -> Any:
        began = time.process_time()
        found = work()
        took[what] = round(time.process_time() - began, 4)
        return found

    whole = many()
    timed("import", lambda: importing(labels, whole, "Ada", ()))
    everything = timed("all labels", lambda: json.dumps(changes_json(labels.info, labels.changes())))
    assert everything.count('"keyframes"') == TRACKS
    for first in (0, 2000, 3990):
        timed(f"window at {first}", lambda first=first: json.dumps(window_json(labels, first, first + 9)))
    move = SetSighting(
        kind="set_sighting", track=500, revision=1, frame=500 * 37 % (FRAMES - LIFE) + 50,
        cuboid={"center": (30.0, 0.0, 0.7), "size": (4.0, 1.8, 1.5), "yaw_rad": 0.0},  # type: ignore[arg-type]
    )  # fmt: skip
    timed("edit", lambda: labels.log.act(move.kind, "Ada", lambda d: do(d, Scope(labels.info.t_ns), move)))
    timed("changes since", lambda: changes_json(labels.info, labels.changes(1)))
    timed("undo", lambda: labels.log.move("undo", "Ada"))
    back = timed("label set", labels.label_set)
    assert back == whole.__class__(**(vars(whole) | {"source": labels.info.uri}))
    timed("truth for scores", lambda: of_labels(back, LeadRule()))
    drive = LabeledDrive(back.source, tuple(FrameInfo(name, t) for name, t in zip(back.frames, back.t_ns, strict=True)))
    for name in FORMATS:
        if name in ("native", "openlabel", "nuscenes", "csv"):
            timed(f"export {name}", lambda name=name: export_labels(back, drive, name, tmp_path / f"{kind}-{name}"))
    timed("undo of the import", lambda: labels.log.move("undo", "Ada"))
    database.close()
    _report(**{kind: took})
    assert max(took[what] for what in took if what.startswith("window")) < SEEK_S
    assert max(took[what] for what in took if what.startswith("export")) < EXPORT_S


@pytest.mark.timeout(3600)
def test_a_hundred_thousand_labels_of_a_real_session_go_out_by_the_command_line(data_dir: Path, tmp_path: Path) -> None:
    """Frames of a real drive, repeated, with camera, points and calibration. Every format in its own process; nuScenes
    counts the points in each cuboid, and a whole session is written."""
    session, labels = tmp_path / "drive.mcap", tmp_path / "labels.json"
    _write_session(session, data_dir / "kitti_0052")
    drive = drive_of(open_source(str(session)))
    whole = replace(many(), source=drive.uri, frames=drive.frames, t_ns=drive.t_ns)
    export_labels(_with_boxes(whole), drive, "native", labels)
    took: dict[str, float] = {}
    for name in FORMATS:
        options = ["--labels", labels, "--format", name, "--out", tmp_path / name]
        took[name] = _cpu_s(["labels", "export", session, *options])
    _report(command_line=took)
    assert max(took[name] for name in took.keys() - {"nuscenes"}) < EXPORT_S
    assert took["nuscenes"] < COUNTING_S


def _cpu_s(command: list[Any]) -> float:
    """CPU time of a command in seconds, over all threads."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, "-c", "from app.cli import main; main()", *map(str, command)], check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return round(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, 2)


def _write_session(path: Path, folder: Path) -> None:
    if not folder.is_dir():
        pytest.skip(f"no KITTI drive at {folder}")
    source = open_source(f"kitti:{folder}")
    frames = [source.frame(index) for index in range(len(source))]
    images = [cv2.imencode(".jpg", each.image.bgr)[1].tobytes() if each.image else b"" for each in frames]
    writer = SessionWriter(path, About(source.uri, source.title, source.rate_hz))
    for index in range(FRAMES):
        frame, encoded, t_ns = frames[index % len(frames)], images[index % len(frames)], index * 100_000_000
        image = replace(frame.image, t_ns=t_ns, encoded=encoded) if frame.image else None
        sweep = replace(frame.sweep, t_ns=t_ns) if frame.sweep else None
        writer.write(replace(frame, index=index, name=f"{index:06d}", t_ns=t_ns, sweep=sweep, image=image))
    writer.close()


def _with_boxes(labels: LabelSet) -> LabelSet:
    """Each sighting with an image box too."""
    box = (500.0, 150.0, 600.0, 220.0)
    return replace(
        labels,
        tracks=tuple(
            replace(track, sightings=tuple(replace(each, bbox=box) for each in track.sightings))
            for track in labels.tracks
        ),
    )


def _report(**figures: Any) -> None:
    REPORT.parent.mkdir(exist_ok=True)
    known = json.loads(REPORT.read_text()) if REPORT.exists() else {}
    REPORT.write_text(json.dumps(known | figures, indent=2))
    print(figures)
