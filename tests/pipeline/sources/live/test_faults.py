"""Sensors come and go: each fault is named, and everything works again within a second of its end."""

from __future__ import annotations

import heapq
import re
from collections.abc import Iterator
from typing import cast

import numpy as np
import pytest

from pipeline.params import SyncParams
from pipeline.replay.faults import Fault
from pipeline.sources.live.devices.gnss import GnssInput
from pipeline.sources.live.devices.lidar import LidarInput
from pipeline.types import Frame
from tests.pipeline.formats.test_nmea import whole
from tests.pipeline.sources.live.bench import CONFIG, MS, SECOND, START, Bench, Taken, sent, small_sweep, stamped

FROM_S, TO_S = 1.2, 2.4
RECOVERED_WITHIN_S = 1.0


def fault(sensor: str, kind: str, **more: float) -> Fault:
    return Fault.model_validate({"sensor": sensor, "kind": kind, "from_s": FROM_S, "to_s": TO_S, **more})


def driven(*faults: Fault, camera_hz: float = 30.0, params: SyncParams | None = None) -> tuple[list[Taken], Bench]:
    bench = Bench()
    taken = bench.drive(sent(faults, camera_hz=camera_hz), params)
    ticks = [each.frame.t_ns for each in taken]
    assert ticks == sorted(set(ticks)), "time never runs back"
    assert all(-0.001 <= each.age_s < 0.3 for each in taken), "nothing old is shown"
    return taken, bench


def during(taken: list[Taken]) -> list[Taken]:
    """The frames during the fault, without the time needed to notice it."""
    return [each for each in taken if FROM_S + 0.5 < each.at_s < TO_S]


def after(taken: list[Taken]) -> list[Taken]:
    return [each for each in taken if each.at_s > TO_S + RECOVERED_WITHIN_S]


def assert_well(taken: list[Taken]) -> None:
    """Check that there are ten frames per second with sweep, image and ego motion."""
    assert len(taken) >= 4
    assert all(each.frame.sweep is not None and each.frame.image is not None for each in taken)
    assert all(each.frame.ego is not None and each.frame.gnss is not None for each in taken)
    np.testing.assert_allclose(np.diff([each.frame.t_ns for each in taken]) / 1e9, 0.1, atol=0.002)
    assert all(each.frame.notes == () for each in taken)


def test_without_trouble_every_sweep_comes_once_with_its_image() -> None:
    taken, bench = driven()
    whole = [each for each in taken if each.frame.sweep is not None]
    assert len(whole) >= 38
    assert_well(whole[5:])
    skews = [abs(f.frame.image.t_ns - f.frame.t_ns) / 1e6 for f in whole[5:] if f.frame.image and f.frame.image.t_ns]
    assert max(skews) < 17.0
    assert bench.source.dropped <= 1
    assert {each.lost for each in bench.source.health()} == {0}
    assert [each.sensor for each in bench.source.health()] == ["lidar", "camera", "gnss", "ego"]


@pytest.mark.parametrize("camera_hz", [30.0, 60.0])
def test_the_image_of_a_tick_is_known_before_its_sweep(camera_hz: float) -> None:
    taken, _ = driven(camera_hz=camera_hz)
    for each in [each for each in taken if each.frame.sweep is not None][5:]:
        assert each.known is not None
        assert each.known.image is not None
        assert each.frame.image is not None
        assert each.known.image.bgr is each.frame.image.bgr, "decoded once"
        assert (each.known.index, each.known.ego) == (each.frame.index, each.frame.ego)
        assert abs(each.known.t_ns - each.frame.t_ns) < 1 * MS


def test_camera_of_60_hz_against_lidar_of_10_hz() -> None:
    taken, _ = driven(camera_hz=60.0)
    whole = [each.frame for each in taken if each.frame.sweep is not None][5:]
    skews = [abs(frame.image.t_ns - frame.t_ns) / 1e6 for frame in whole if frame.image and frame.image.t_ns]
    assert len(skews) == len(whole)
    assert max(skews) < 8.5


def test_lidar_falls_silent_and_the_camera_ticks() -> None:
    taken, _ = driven(fault("lidar", "silence"))
    assert len(during(taken)) >= 15, "30 Hz"
    assert all(each.frame.sweep is None and each.frame.image is not None for each in during(taken))
    assert all(any("lidar" in note for note in each.frame.notes) for each in during(taken))
    first = next(each for each in taken if each.at_s > TO_S and each.frame.sweep is not None)
    assert first.at_s - TO_S < 0.35
    assert_well(after(taken))


def test_the_camera_falls_silent_and_lidar_goes_on() -> None:
    taken, _ = driven(fault("camera", "silence"))
    assert len(during(taken)) >= 6
    assert all(each.frame.sweep is not None and each.frame.image is None for each in during(taken))
    assert any("camera silent" in note for each in during(taken) for note in each.frame.notes)
    assert_well(after(taken))


def test_the_receiver_falls_silent_and_own_motion_is_unknown_not_old() -> None:
    taken, _ = driven(fault("gnss", "silence"))
    late = [each for each in during(taken) if each.at_s > FROM_S + 0.7]
    assert late
    assert all(each.frame.ego is None and each.frame.gnss is None for each in late)
    assert_well(after(taken))


def test_all_fall_silent() -> None:
    silent = [fault(sensor, "silence") for sensor in ("lidar", "camera", "gnss")]
    taken, _ = driven(*silent)
    assert during(taken) == []
    assert_well(after(taken))


@pytest.mark.parametrize("sensor", ["lidar", "camera", "gnss"])
def test_garbage_between_costs_nothing(sensor: str) -> None:
    taken, bench = driven(fault(sensor, "garbage"))
    whole = [each for each in taken if each.frame.sweep is not None]
    assert len(whole) >= 38
    assert_well(whole[5:])
    stats = bench.source.inputs[sensor].stats
    assert stats.refused.total() + stats.lost > 0, "and is counted"


@pytest.mark.parametrize("kind", ["duplicate", "out_of_order"])
def test_packets_doubled_or_overtaken_cost_no_sweep(kind: str) -> None:
    """Only a packet overtaken by the first one of the next rotation cannot be restored to its place."""
    taken, bench = driven(*(fault(sensor, kind) for sensor in ("lidar", "camera", "gnss")))
    whole = [each for each in taken if each.frame.sweep is not None]
    assert len(whole) >= 38
    assert_well(whole[5:])
    points = [len(each.frame.sweep.points) for each in whole[3:] if each.frame.sweep is not None]
    assert min(points) >= len(small_sweep(0).points) * 74 / 75 - 16
    assert np.mean(np.array(points) == len(small_sweep(0).points)) > 0.9
    assert bench.source.inputs["lidar"].stats.lost <= 3


@pytest.mark.parametrize("by_s", [7.0, -7.0, 0.3, -0.3])
@pytest.mark.parametrize("sensor", ["lidar", "camera", "gnss"])
def test_a_clock_that_is_set_is_followed_within_a_second_there_and_back(sensor: str, by_s: float) -> None:
    taken, _ = driven(fault(sensor, "clock_jump", by_s=by_s))
    there = [each for each in taken if FROM_S + RECOVERED_WITHIN_S < each.at_s < TO_S]
    assert there
    for each in [*there, *after(taken)]:
        assert each.frame.sweep is not None
        assert each.frame.image is not None
        assert each.frame.ego is not None
        assert each.age_s < 0.15
    assert_well(after(taken))


def test_packets_lost_on_the_way_are_counted() -> None:
    lost = Fault(sensor="lidar", kind="silence", from_s=1.2, to_s=1.21)
    taken, bench = driven(lost)
    assert 7 <= bench.source.inputs["lidar"].stats.lost <= 8, "ten milliseconds of 1.327 ms each"
    assert len([each for each in taken if each.frame.sweep is not None]) >= 38


def test_an_image_that_is_damaged_inside_is_said() -> None:
    bench = Bench()
    events = list(sent([]))
    broken = b"\xff\xd8" + bytes(300) + b"\xff\xd9"
    events = [event._replace(payload=broken) if event.sensor == "camera" else event for event in events]
    taken = bench.drive(iter(events))
    assert all(each.frame.image is None for each in taken)
    assert "the image is damaged" in taken[-1].frame.notes


def test_an_image_of_another_size_than_calibrated_is_not_projected_into() -> None:
    calibration = {"fx_px": 900, "fy_px": 900, "cx_px": 640, "cy_px": 360, "width_px": 1280, "height_px": 720}
    bench = Bench(
        {"lidar": {"position_port": None}, "camera": {"url": "http://127.0.0.1:9/", "calibration": calibration}}
    )
    events = (event for event in sent([], seconds=1.0) if event.sensor != "gnss")
    frame = bench.drive(events)[-1].frame
    assert frame.camera is None
    assert "images are 64×48, but the calibration is for 1280×720: calibration not used" in frame.notes


def test_offsets_are_turned_while_it_runs() -> None:
    taken, _ = driven(params=SyncParams(camera_offset_ms=-15.0))
    plain, _ = driven()
    moved = {f.frame.t_ns: f.frame.image.t_ns for f in taken[10:] if f.frame.image and f.frame.image.t_ns}
    stood = {f.frame.t_ns: f.frame.image.t_ns for f in plain[10:] if f.frame.image and f.frame.image.t_ns}
    both = sorted(moved.keys() & stood.keys())
    assert len(both) > 20
    steps = {round((moved[t] - stood[t]) / 1e6) for t in both}
    assert steps <= {-15, 18}, "15 ms earlier, or the next image of 33 ms"


def test_whoever_takes_too_late_gets_the_newest_and_the_rest_is_counted() -> None:
    bench = Bench()
    for event in sent([], seconds=2.0):
        bench.clock.at_ns = event.send_ns
        bench.give(event)
    frame = bench.source.next(0.0)
    assert frame is not None
    assert (bench.clock.at_ns - frame.t_ns) / 1e6 < 200.0, "the newest whole sweep"
    assert bench.source.dropped >= 18
    assert frame.index == bench.source.dropped
    assert bench.source.next(0.0) is None


def test_figures_of_health_are_those_of_the_wire() -> None:
    taken, _ = driven()
    streams = {each.sensor: each for each in taken[-1].frame.streams}
    for sensor, rate in {"lidar": 10.0, "camera": 30.0, "gnss": 10.0, "ego": 10.0}.items():
        assert streams[sensor].rate_hz == pytest.approx(rate, rel=0.03)
        assert streams[sensor].state == "ok"
    assert streams["lidar"].age_ms == pytest.approx((taken[-1].at_s - (taken[-1].frame.t_ns - START) / 1e9) * 1e3)


def test_what_is_refused_is_counted_on_both_ports_and_says_why() -> None:
    bench = Bench()
    lidar = cast("LidarInput", bench.source.inputs["lidar"])
    lidar.receive_position(b"\0" * 100, START)
    bench.drive(sent([]))
    assert lidar.stats.health(START).note == "1 packet refused: 1 not 512 bytes on the position port"
    lidar.receive(bytes(1206), bench.clock.at_ns)
    lidar.receive(b"\xff\xee" * 602 + b"\x37\x28", bench.clock.at_ns)
    said = lidar.stats.health(START).note
    assert said.startswith("3 packets refused: ")
    assert "1 all zero" in said
    assert "not a VLP-16 but VLP-32C" in said, "after good sweeps, too"


def test_a_receiver_that_talks_but_lost_its_position_says_so() -> None:
    bench = Bench()
    gnss = cast("GnssInput", bench.source.inputs["gnss"])

    def note(has_fix: bool, second: int) -> str:
        clock, state, quality = f"2215{second:02d}.00", "A" if has_fix else "V", 4 if has_fix else 0
        place = "4800.0000,N,01100.0000,E" if has_fix else ",,,"
        gga = f"GPGGA,{clock},{place},{quality},12,0.8,500.0,M,0.0,M,,"
        bodies = gga, f"GPRMC,{clock},{state},{place},0.0,,141123,,,N"
        gnss.receive("\r\n".join(map(whole, bodies)).encode(), START + second * 1_000_000_000)
        return gnss.stats.note

    is_there = [False, False, True, True, False, False, True, True]
    said = [note(has_fix, second) for second, has_fix in enumerate(is_there)]
    assert said[1] == "no fix yet"
    assert (said[3], said[7]) == ("", "")
    assert said[5] == "no fix: the receiver has lost its position"


def packets_of(bench: Bench, seconds: float, other: bool = False) -> Iterator[tuple[int, bytes]]:
    """(send time, packet) of a LiDAR that sees a wall 20 m away, or of another one."""
    for event in sent([], seconds=seconds):
        if event.sensor == "lidar":
            stamp_ns = event.stamp_ns + (1_500 * MS + 700_000 if other else 0)
            yield event.send_ns, stamped(event._replace(stamp_ns=stamp_ns))


@pytest.mark.parametrize("jump_s", [-7.25, 3.5, 1800.0])
def test_a_clock_that_jumps_is_said_and_spoils_no_sweep(jump_s: float) -> None:
    bench = Bench()
    lidar = cast("LidarInput", bench.source.inputs["lidar"])
    taken: list[Frame] = []
    for event in sent([], seconds=4.0):
        bench.clock.at_ns = event.send_ns
        jumped = event.sensor == "lidar" and event.send_ns - START > 2 * SECOND
        bench.give(event._replace(stamp_ns=event.stamp_ns + round(jump_s * SECOND)) if jumped else event)
        if (frame := bench.source.next(0.0)) is not None and frame.sweep is not None:
            taken.append(frame)
    assert lidar.stats.health(bench.clock.at_ns).note.startswith(f"its clock jumped once by {jump_s:+.1f}")
    assert len(taken) >= 36, "one or two sweeps are lost where it jumps"
    assert all(abs(len(f.sweep.points) - len(taken[5].sweep.points)) < 50 for f in taken[3:] if f.sweep)
    ages_s = [(bench.clock.at_ns - START - (frame.t_ns - START)) / SECOND for frame in taken[-1:]]
    assert max(ages_s) < 0.3, "on the host's timeline as before"


def test_a_second_lidar_with_the_same_address_is_said_and_spoils_no_sweep() -> None:
    """Both have the factory address 192.168.1.201. Only times and azimuths distinguish their packets."""
    bench = Bench()
    lidar = cast("LidarInput", bench.source.inputs["lidar"])
    sizes = []
    mixed = heapq.merge(packets_of(bench, 4.0), packets_of(bench, 4.0, other=True))
    for send_ns, packet in mixed:
        bench.clock.at_ns = send_ns
        lidar.receive(packet, send_ns)
        if (frame := bench.source.next(0.0)) is not None and frame.sweep is not None:
            sizes.append(len(frame.sweep.points))
    assert "does a second LiDAR have the same address?" in lidar.stats.health(bench.clock.at_ns).note
    assert len(sizes) >= 30
    assert max(sizes) - min(sizes[3:]) < 100


def test_messages_measured_at_an_impossible_time_are_refused_and_said() -> None:
    late = {"camera": {"url": "http://127.0.0.1:9/", "time_offset_ms": -2000.0}}
    bench = Bench({**CONFIG, **late})
    assert all(each.frame.image is None for each in bench.drive(sent([], seconds=1.0)))
    camera = next(each for each in bench.source.health() if each.sensor == "camera")
    assert re.fullmatch(r"\d+ refused: impossible timestamp", camera.note)
