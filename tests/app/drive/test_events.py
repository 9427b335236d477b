"""What happened on a drive: each kind of event by named cases, and on real and simulated drives."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.drive.events import find_events
from app.drive.events.event import Event
from app.drive.events.marks import recorded_marks
from app.drive.events.sensors import DISAGREEMENT_FRAMES
from app.drive.frame_rows import Objects, Row, objects_of, row_of
from pipeline.detection import Detectors, detector_for
from pipeline.params import Params
from pipeline.run import run
from pipeline.sources import open_source
from pipeline.types.source import Mark
from tests.app.drive.rows import beside, drive, inside, objects, row

NO_OBJECTS = objects()


def found(rows: list[Row], frames: dict[int, Objects] | None = None, kind: str | None = None) -> list[Event]:
    """Events of a drive; ``frames`` gives the objects of frames that have any."""
    held = [(frames or {}).get(index, NO_OBJECTS) for index in range(len(rows))]
    return [event for event in find_events(rows, held, Params()) if kind is None or event.kind == kind]


def told(events: list[Event]) -> list[tuple[str, int, tuple[int, ...]]]:
    return [(event.kind, event.index, event.ids) for event in events]


@pytest.mark.parametrize(
    ("name", "leads", "frames", "expected"),
    [
        ("nothing ever", [None, None], {}, []),
        ("a car comes", [None, 7, 7], {}, [("first_acquisition", 1, (7,))]),
        ("it is there from the start", [7, 7], {}, [("first_acquisition", 0, (7,))]),
        ("another takes over", [7, 8], {}, [("first_acquisition", 0, (7,)), ("cipv_switch", 1, (8, 7))]),
        ("it is lost", [7, None], {}, [("first_acquisition", 0, (7,)), ("cipv_lost", 1, (7,))]),
        (
            "it is lost and found",
            [7, None, 7],
            {},
            [("first_acquisition", 0, (7,)), ("cipv_lost", 1, (7,)), ("cipv_switch", 2, (7,))],
        ),
        (
            "it leaves the path",
            [7, None],
            {1: objects(beside(7))},
            [("first_acquisition", 0, (7,)), ("cut_out", 1, (7,))],
        ),
        (
            "it leaves the path before another",
            [7, 9],
            {1: objects(beside(7), inside(9))},
            [("first_acquisition", 0, (7,)), ("cut_out", 1, (7, 9))],
        ),
        (
            "one from beside comes before it",
            [None, None, None, 9],
            {n: objects(beside(9)) for n in range(3)} | {3: objects(inside(9))},
            [("cut_in", 3, (9,))],
        ),
        (
            "seen beside in one frame only is no cut-in",
            [None, None, 9],
            {1: objects(beside(9)), 2: objects(inside(9))},
            [("first_acquisition", 2, (9,))],
        ),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_who_leads(name: str, leads: list[int | None], frames: dict[int, Objects], expected: list[Any]):
    assert told(found(drive(*leads), frames)) == expected


def test_a_cut_in_is_nearer_than_the_lead_it_comes_before():
    frames = {n: objects(inside(7), beside(9)) for n in range(4)}
    nearer = [*drive(7, 7, 7, 7), row(4, 9, distance_m=15.0)]
    farther = [*drive(7, 7, 7, 7), row(4, 9, distance_m=45.0)]
    assert told(found(nearer, frames))[-1] == ("cut_in", 4, (9, 7))
    assert told(found(farther, frames))[-1] == ("cipv_switch", 4, (9, 7))


def test_after_a_gap_in_the_recording_a_lead_is_acquired_not_switched():
    rows = [*drive(7, 7, 7, 7), row(100, 8), row(101, 8)]
    assert told(found(rows)) == [
        ("first_acquisition", 0, (7,)),
        ("first_acquisition", 4, (8,)),
        ("sensor_gap", 4, ()),
    ]


@pytest.mark.parametrize(
    ("name", "ttcs", "expected"),
    [
        ("closing in", [7.0, 5.0, 3.0, 4.0], [(2, "info")]),
        ("never short", [20.0, 15.0, 12.0], []),
        ("unknown", [None, None], []),
        ("short enough to warn", [3.0, 2.1], [(1, "warning")]),
        ("short enough to brake", [3.0, 1.2, 2.0], [(1, "alarm")]),
        ("a short hole is one approach", [5.0, None, None, 4.0], [(3, "info")]),
        ("a long hole parts two", [5.0, *[None] * 6, 4.0], [(0, "info"), (7, "info")]),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_the_shortest_ttc_of_each_approach(name: str, ttcs: list[float | None], expected: list[Any]):
    rows = [row(index, 7, ttc_s=ttc) for index, ttc in enumerate(ttcs)]
    assert [(event.index, event.severity) for event in found(rows, kind="ttc_minimum")] == expected


def test_recorded_marks_are_at_their_frames():
    rows = [row(index, 7) for index in range(4)]
    marks = [Mark(rows[2].t_ns, "he braked"), Mark(rows[0].t_ns, "begin"), Mark(rows[3].t_ns + 10**12, "not run yet")]
    events = recorded_marks([row.t_ns for row in rows], marks)
    assert [(event.kind, event.index, event.text, event.mark) for event in events] == [
        ("mark", 2, "he braked", None),
        ("mark", 0, "begin", None),
    ]


def test_each_lead_has_an_approach_of_its_own():
    rows = [row(0, 7, ttc_s=4.0), row(1, 7, ttc_s=3.0), row(2, 8, ttc_s=5.0), row(3, 8, ttc_s=6.0)]
    assert [(event.index, event.ids) for event in found(rows, kind="ttc_minimum")] == [(1, (7,)), (2, (8,))]


@pytest.mark.parametrize(
    ("name", "states", "brakes", "expected"),
    [
        ("cruising", ["cruise"] * 3, [0.0] * 3, []),
        ("a warning", ["follow", "warn", "warn"], [0.1] * 3, [("warning", 1)]),
        (
            "it grows",
            ["follow", "warn", "partial_brake", "full_brake"],
            [0.1] * 4,
            [("warning", 1), ("brake", 2), ("brake", 3)],
        ),
        ("it is released and comes again", ["warn", "follow", "warn"], [0.1] * 3, [("warning", 0), ("warning", 2)]),
        ("ACC brakes hard once", ["follow"] * 3, [0.1, 0.5, 0.6], [("brake", 1)]),
        ("no own speed, no ACC", [None] * 2, [None] * 2, []),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_warnings_and_braking(name: str, states: list[Any], brakes: list[Any], expected: list[Any]):
    rows = [
        row(index, 7, acc_state=state, brake=brake, accel_mps2=-3.0)
        for index, (state, brake) in enumerate(zip(states, brakes, strict=True))
    ]
    events = [event for event in found(rows) if event.kind in ("warning", "brake")]
    assert [(event.kind, event.index) for event in events] == expected


def test_two_distances_of_one_object_are_told_once_and_only_in_the_path():
    apart = {"id": 4, "vl_gap_m": -6.0, "vl_gap_sigmas": 4.0}
    agreeing = {"id": 5, "vl_gap_m": 1.0, "vl_gap_sigmas": 1.0}
    aside = apart | {"id": 6, "in_path": False}
    frames = {index: objects(apart, agreeing, aside) for index in range(1, 6)}
    events = found(drive(*[None] * 6), frames)
    assert told(events) == [("vl_disagreement", DISAGREEMENT_FRAMES, (4,))]
    assert "6.0 m nearer" in events[0].text


@pytest.mark.parametrize(
    ("name", "gaps", "expected"),
    [
        ("all there", ["", "", ""], []),
        ("never had", ["ego", "ego", "ego"], []),
        ("camera misses two", ["", "camera", "camera", ""], [(1, "no camera data for 2 frames")]),
        ("missing to the end", ["", "", "lidar"], [(2, "no lidar data for 1 frame")]),
        (
            "two at once, one the recording never has",
            ["ego", "camera,ego,lidar", "ego"],
            [(1, "no camera data for 1 frame"), (1, "no lidar data for 1 frame")],
        ),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_sensor_gaps(name: str, gaps: list[str], expected: list[Any]):
    rows = [row(index, gaps=gap) for index, gap in enumerate(gaps)]
    assert [(event.index, event.text) for event in found(rows, kind="sensor_gap")] == expected


@given(st.lists(st.sampled_from([None, 1, 2, 3]), max_size=30), st.integers(0, 30))
def test_events_come_by_frame_within_the_drive_and_a_longer_drive_keeps_who_led(leads: list[int | None], cut: int):
    events = found(drive(*leads))
    assert [event.index for event in events] == sorted(event.index for event in events)
    assert all(0 <= event.index < len(leads) for event in events)
    earlier = [event for event in events if event.index < cut]
    assert found(drive(*leads[:cut])) == earlier


def events_of(uri: str, detector: str | None = None, frames: int = 10_000) -> list[Event]:
    source = open_source(uri)
    rows, held = [], []
    for frame, result in run(source, Params(), Detectors(detector_for(source, detector))):
        rows.append(row_of(frame, result))
        held.append(objects_of(result))
        if len(rows) == frames:
            break
    return find_events(rows, held, Params())


def test_the_simulated_cut_in_is_found():
    """The car changes lane between 3.5 and 5.5 s and is in the lane before the middle of it."""
    cut_ins = [event for event in events_of("sim:cut_in", frames=60) if event.kind == "cut_in"]
    assert len(cut_ins) == 1
    assert 35 <= cut_ins[0].index <= 55
    assert cut_ins[0].ids[0] == 2


def test_real_drives_tell_of_their_gaps_and_of_who_was_acquired(data_dir: Path):
    """Astyx: five clips with seconds to minutes between them; the lead of each is acquired once."""
    events = events_of(f"astyx:{data_dir / 'astyx'}", str(data_dir / "models" / "yolox_nano.onnx"))
    jumps = [event.index for event in events if event.kind == "sensor_gap"]
    assert jumps == [5, 14, 17, 27]
    begins = [event.index for event in events if event.kind in ("first_acquisition", "cut_in")]
    assert np.isin([17, 27], begins).all()
    assert not [event for event in events if event.kind == "warning"], "own speed is the LiDAR's; ACC slows down gently"
