"""Which seconds are worth labeling, and how they come into the labeling queue."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from app.cli import main
from app.fleet.batch.work import run_drive
from app.fleet.find import FleetTables
from app.fleet.mining.choose import APART_S, LEAST, choose
from app.fleet.mining.seconds import FleetFrames, Seconds, inconsistency, novelty, seconds_of
from app.fleet.pack import pack
from app.fleet.store import Store
from app.labels.service.next_work import Asked, where_next
from app.labels.service.scoring import LabelScores
from app.labels.store.database import open_database
from app.labels.store.drive_labels import DriveLabels, info_of
from app.labels.store.work import queue
from pipeline.labels.model import LeadRange, Origin
from pipeline.sources import open_source
from tests.app.fleet.fleets import begun, make_fleet, plan_of

RATE_HZ = 10


def frames_of(drives: int, seconds: int, **changed: object) -> FleetFrames:
    """Drives behind a car at 30 m, whose distance shrinks by 1 m/s."""
    count = drives * seconds * RATE_HZ
    drive = np.repeat(np.arange(drives), seconds * RATE_HZ)
    t_s = np.tile(np.arange(seconds * RATE_HZ) / RATE_HZ, drives)
    same = {name: np.full(count, 1.0) for name in FleetFrames._fields}
    known = {"drive": drive, "t_s": t_s, "cipv_id": np.full(count, 7), "distance_m": 60.0 - t_s}
    return FleetFrames(**(same | known | {"sigma_m": np.full(count, 0.1)} | changed))  # type: ignore[arg-type]


def begins_of(frames: FleetFrames) -> np.ndarray:
    return np.arange(0, len(frames.drive), RATE_HZ)


def test_a_steady_lead_contradicts_nothing():
    assert not inconsistency(frames_of(2, 5)).any()


def test_a_lead_that_is_lost_and_back_soon_is_a_contradiction():
    ids = np.full(100, 7)
    ids[30:34] = -1
    found = inconsistency(frames_of(2, 5, cipv_id=ids))
    assert np.flatnonzero(found).tolist() == [30]
    ids = np.full(100, 7)
    ids[20:45] = 9
    assert not inconsistency(frames_of(2, 5, cipv_id=ids)).any(), "away for 2.5 s: another lead"
    ids = np.full(100, 7)
    ids[45:50] = -1
    assert not inconsistency(frames_of(2, 5, cipv_id=ids)).any(), "the same number in the next drive is another car"


def test_a_distance_that_jumps_is_a_contradiction_as_large_as_the_jump():
    frames = frames_of(1, 5)
    distance_m = frames.distance_m.copy()
    distance_m[25:] += 1.0
    found = inconsistency(frames._replace(distance_m=distance_m))
    assert np.flatnonzero(found).tolist() == [25]
    assert found[25] == pytest.approx(1.0 / np.hypot(0.1, 0.1) / 4.0)
    assert not inconsistency(frames._replace(distance_m=distance_m, sigma_m=np.full(50, 1.0))).any()


def test_what_no_other_drive_knows_is_novel_even_if_its_own_drive_is_full_of_it():
    frames = frames_of(20, 4)
    speed = np.random.default_rng(0).normal(20.0, 1.0, len(frames.drive))
    speed[frames.drive == 3] = 60.0
    found = novelty(frames._replace(speed_mps=speed), begins_of(frames)).reshape(20, 4)
    assert found[3].min() > 3 * np.delete(found, 3, axis=0).max()


def test_one_drive_alone_is_not_novel():
    frames = frames_of(1, 4)
    assert not novelty(frames, begins_of(frames)).any()


def seconds_with(**values: list[float]) -> Seconds:
    """Two drives of ten seconds."""
    second = np.tile(np.arange(10), 2)
    none = {name: np.zeros(20) for name in LEAST}
    given = {name: np.array(each) for name, each in values.items()}
    return Seconds(np.repeat([0, 1], 10), second, second * 10, second * 10 + 9, ("a", "b"), none | given)


def test_reasons_take_turns_and_neighbours_are_left_out():
    seconds = seconds_with(disagreement=[9, 8, 7, 6, 5, 4, 0, 0, 0, 0] + [3.5] + [0.0] * 9, margin=[0.0] * 19 + [0.9])
    chosen = choose(seconds, 10, 10)
    assert [(each.address, each.second, each.reason) for each in chosen] == [
        ("a", 0, "disagreement"),
        ("b", 9, "margin"),
        ("a", 3, "disagreement"),
        ("b", 0, "disagreement"),
    ]
    assert choose(seconds, 2, 10) == chosen[:2]
    assert [each.address for each in choose(seconds, 10, 1)] == ["a", "b"]
    known = choose(seconds, 10, 10, lambda address, first, last: (address, first, last) == ("a", 0, 9))
    assert [(each.address, each.second) for each in known] == [("a", 1), ("b", 9), ("a", 4), ("b", 0)]
    assert APART_S == 3


def test_neighbours_of_what_is_queued_already_are_left_out():
    seconds = seconds_with(disagreement=[9, 8, 7, 6, 5, 4, 3.5, 3.4, 3.3, 3.2] + [0.0] * 10)
    queued: list[tuple[str, int, int]] = []

    def is_queued(address: str, first: int, last: int) -> bool:
        return any(address == of and first <= end and begin <= last for of, begin, end in queued)

    for expected in ([0, 3], [6, 9], []):
        chosen = choose(seconds, 2, 10, is_queued=is_queued)
        assert [each.second for each in chosen] == expected
        queued += [(each.address, each.first, each.last) for each in chosen]


def test_values_that_are_too_small_are_no_reason():
    assert choose(seconds_with(disagreement=[2.9] * 20, margin=[0.4] * 20, novelty=[0.9] * 20), 10, 10) == []


@pytest.fixture(scope="module")
def batch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A batch of three short drives, with LiDAR alone."""
    folder = tmp_path_factory.mktemp("mining")
    work = begun(plan_of(make_fleet(folder / "in"), sensors="lidar"), folder / "out")
    for job in work.jobs:
        run_drive(job)
    pack(Store(str(folder / "out")), work.key.name)
    return folder / "out"


def test_seconds_of_tables_are_those_of_their_frames(batch: Path):
    tables = FleetTables(Store(str(batch)))
    seconds = seconds_of(tables)
    assert len(seconds.second) == len(seconds.addresses) == 3
    assert (seconds.first.tolist(), seconds.last.tolist()) == ([0, 0, 0], [7, 7, 7])
    assert all(Path(each).is_file() for each in seconds.addresses)
    rows = tables.rows("objects")
    for drive, address in enumerate(seconds.addresses):
        frames = {row["index"]: row for row in tables.rows("frames") if row["address"] == address}
        likely = [
            1.0 - abs(2.0 * row["in_path_probability"] * (row["existence_probability"] or 1.0) - 1.0)
            for row in rows
            if row["address"] == address
            and row["seen_by"]
            and row["distance_m"] <= (frames[row["index"]]["distance_m"] or 60.0) + 0.5
        ]
        assert seconds.values["margin"][drive] == pytest.approx(max(likely, default=0.0), abs=1e-6)
    assert seconds.values["margin"].max() > 0.0


def cipv(*arguments: object) -> int:
    with pytest.raises(SystemExit) as end:
        main([str(argument) for argument in arguments])
    return int(end.value.code or 0)


def test_chosen_seconds_come_into_the_labeling_queue_once(
    batch: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    url = f"sqlite:///{tmp_path / 'labels.db'}"
    typed = ("mine", "--out", batch, "--queue", "--database", url, "--json")
    assert cipv(*typed) == 0
    found = json.loads(capsys.readouterr().out)
    assert found
    database = open_database(url)
    try:
        waiting = {each.uri: each for each in queue(database) if each.asked}
        assert waiting.keys() == {each["address"] for each in found}
        assert all(each.asked == 8 and each.worth == 1.0 for each in waiting.values())
        first = found[0]
        labels = DriveLabels(database, info_of(open_source(first["address"]), tuple))
        place, why, left = where_next(labels, LabelScores(), None, Asked("asked", -1, 1))
        assert place is not None
        assert (place.frame, left) == (first["first"], 1)
        assert first["text"] in why
        assert cipv(*typed) == 0
        assert json.loads(capsys.readouterr().out) == [], "queued twice"
        said = LeadRange(0, 7, "none", "accepted", Origin("person", "Ada", 1))
        labels.log.act("set_lead", "Ada", lambda draft: str(draft.add("lead", said)))
        assert where_next(labels, LabelScores(), None, Asked("asked", -1, 1))[0] is None
        assert {each.uri: each.asked for each in queue(database)}[first["address"]] == 0
    finally:
        database.close()


def test_cipv_mine_prints_links(batch: Path, capsys: pytest.CaptureFixture[str]):
    assert cipv("mine", "--out", batch, "--json", "--count", 1) == 0
    (found,) = json.loads(capsys.readouterr().out)
    assert found["link"].startswith("http://127.0.0.1:8420/#uri=")
    assert cipv("mine", "--out", batch) == 0
    assert "even odds" in capsys.readouterr().out


@pytest.mark.parametrize(
    "more", [("--count", "0"), ("--per-drive", "0"), ("--run", "nothing"), ("--database", "nonsense", "--queue")]
)
def test_bad_input_is_said_in_one_line(batch: Path, more: tuple[str, ...], capsys: pytest.CaptureFixture[str]):
    assert cipv("mine", "--out", batch, *more) == 2
    said = capsys.readouterr().err.strip().splitlines()
    assert len(said) == 1, said
    assert said[0].startswith("cipv: ")
