"""What goes over the wire and when; and what faults do to it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.common.errors import BadInput
from pipeline.formats.velodyne import VelodyneDecoder
from pipeline.replay.faults import Fault, disconnected, disturb, load
from pipeline.replay.messages import Message, of_recording
from pipeline.replay.wire import ROTATION_NS, WireEvent, to_wire
from pipeline.sources import open_source
from pipeline.types import Sweep

MS = 1_000_000
START = 1_700_000_000_000 * MS


def sweep(t_ms: float) -> Sweep:
    return Sweep(round(t_ms * MS), np.array([[10.0, 0.0, 0.0, 9.0]], np.float32), np.array([8], np.uint8), 16)


def lidar(*t_ms: float) -> list[Message]:
    return [Message(round(t * MS), "lidar", sweep(t)) for t in t_ms]


def decoded(events: list[WireEvent]) -> list[Sweep]:
    decoder = VelodyneDecoder()
    found = []
    for event in events:
        stamp = (event.stamp_ns // 1000 % 3_600_000_000).to_bytes(4, "little")
        found.append(decoder.push(event.payload[:1200] + stamp + event.payload[1204:], event.send_ns))
    return [each for each in [*found, decoder.flush()] if each is not None]


def test_a_recording_on_the_wire_decodes_to_its_own_sweeps() -> None:
    """Points are reproduced within a VLP-16's azimuth step of 0.2° and its range resolution of 2 mm."""
    source = open_source("sim:straight")
    recorded = [source.frame(index).sweep for index in range(3)]
    messages = [message for message in of_recording(source, 0, 2) if message.sensor == "lidar"]
    sweeps = decoded(list(to_wire(messages, START)))
    assert len(sweeps) == 3
    for before, after in zip(recorded, sweeps, strict=True):
        assert before is not None
        assert len(after.points) >= 0.97 * len(before.points)
        for ring in (4, 8, 11):
            was, now = before.points[before.ring == ring], after.points[after.ring == ring]
            assert abs(len(was) - len(now)) <= 0.05 * len(was) + 3
            gap = np.linalg.norm(was[:, None, :3] - now[None, :, :3], axis=2).min(axis=1)
            allowed = np.radians(0.2) * np.linalg.norm(was[:, :3], axis=1) + 0.02
            assert np.mean(gap <= allowed) > 0.97
    ticks = np.diff([each.t_ns for each in sweeps])
    np.testing.assert_allclose(ticks, 100 * MS, atol=0.2 * MS)


def test_packets_are_sent_in_order_when_their_last_laser_has_fired() -> None:
    events = list(to_wire(lidar(0, 100, 200), START))
    assert len(events) == 3 * 75
    sent = [event.send_ns for event in events]
    assert sent == sorted(sent)
    assert all(event.send_ns - event.stamp_ns == round(1.327104 * MS) for event in events)
    assert START <= sent[0] < START + 30 * MS


def test_other_sensors_are_sent_between_the_packets_of_a_sweep() -> None:
    messages = [*lidar(0), Message(0, "camera", b"jpeg"), *lidar(100), Message(100 * MS, "camera", b"jpeg")]
    kinds = "".join("L" if event.sensor == "lidar" else "C" for event in to_wire(messages, START))
    assert kinds.count("C") == 2
    assert 30 < kinds.index("C") < 45


@pytest.mark.parametrize(("speed", "sweeps"), [(1.0, 10), (2.0, 5), (0.5, 10)])
def test_faster_leaves_sweeps_out_because_the_head_turns_as_it_does(speed: float, sweeps: int) -> None:
    events = list(to_wire(lidar(*(100.0 * k for k in range(10))), START, speed))
    assert len(events) == sweeps * 75
    starts = [event.stamp_ns for event in events[::75]]
    assert min(np.diff(starts)) >= ROTATION_NS


def events_of(count: int = 100, step_ms: float = 10.0) -> list[WireEvent]:
    return [WireEvent(START + round(k * step_ms * MS), "lidar", START + k, bytes([k])) for k in range(count)]


def during(kind: str, **more: object) -> list[WireEvent]:
    fault = Fault.model_validate({"sensor": "lidar", "kind": kind, "from_s": 0.3, "to_s": 0.5, **more})
    return list(disturb(events_of(), [fault], START))


def test_faults_last_as_long_as_they_shall_and_touch_their_sensor_only() -> None:
    other = Fault(sensor="camera", kind="silence", from_s=0.0, to_s=1.0)
    assert list(disturb(events_of(), [other], START)) == events_of()
    kept = during("silence")
    assert [event.payload[0] for event in kept] == [*range(30), *range(50, 100)]


def test_out_of_order_loses_nothing() -> None:
    payloads = [event.payload[0] for event in during("out_of_order")]
    assert sorted(payloads) == list(range(100))
    swapped = [k for k in range(99) if payloads[k] > payloads[k + 1]]
    assert len(swapped) == 4
    assert all(30 <= payloads[k] < 51 for k in swapped)


def test_duplicates_are_sent_twice() -> None:
    payloads = [event.payload[0] for event in during("duplicate")]
    assert sorted(set(payloads)) == list(range(100))
    assert len(payloads) == 104


def test_a_clock_jump_is_in_the_stamps_only() -> None:
    events = during("clock_jump", by_s=5.0)
    assert [event.send_ns for event in events] == [event.send_ns for event in events_of()]
    off = [event.stamp_ns - START - k for k, event in enumerate(events)]
    assert set(off[30:50]) == {5_000 * MS}
    assert set(off[:30] + off[50:]) == {0}


def test_garbage_comes_between_and_is_the_same_each_time() -> None:
    assert during("garbage") == during("garbage")
    assert len(during("garbage")) == 120


def test_a_plug_is_out_while_it_is_out() -> None:
    fault = Fault(sensor="camera", kind="disconnect", from_s=1.0, to_s=2.0)
    assert [disconnected([fault], "camera", t) for t in (0.9, 1.0, 1.9, 2.0)] == [False, True, True, False]
    assert not disconnected([fault], "lidar", 1.5)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("[{sensor: radar, kind: silence, from_s: 0, to_s: 1}]", "0.sensor"),
        ("[{sensor: lidar, kind: silence, from_s: 2, to_s: 1}]", "to_s must be after from_s"),
        ("{", "not YAML"),
    ],
)
def test_a_wrong_list_of_faults_gives_one_sentence(tmp_path: Path, text: str, complaint: str) -> None:
    path = tmp_path / "faults.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(BadInput, match=complaint):
        load(path)
