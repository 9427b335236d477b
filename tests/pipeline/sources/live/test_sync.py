"""Which messages belong together, as a table of times: no threads, no clock."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.params import SyncParams
from pipeline.sources.live.sync import SensorBuffer, Synchroniser, Together, Upcoming
from pipeline.types import EgoState, Sweep

MS = 1_000_000
START = 1_700_000_000_000 * MS


def sweep(t_ms: float) -> Sweep:
    return Sweep(START + round(t_ms * MS), np.zeros((1, 4), np.float32), np.zeros(1, np.uint8), 16)


@dataclass
class Bench:
    """A bench with times in milliseconds after the start."""

    sync: Synchroniser[str] = field(default_factory=Synchroniser)
    params: SyncParams = field(default_factory=SyncParams)

    def lidar(self, t_ms: float, arrived_ms: float) -> None:
        self.sync.sweeps.add(START + round(t_ms * MS), sweep(t_ms), START + round(arrived_ms * MS))

    def camera(self, t_ms: float, arrived_ms: float | None = None) -> None:
        arrived_ms = t_ms if arrived_ms is None else arrived_ms
        self.sync.images.add(START + round(t_ms * MS), f"at {t_ms:g}", START + round(arrived_ms * MS))

    def tick(self, now_ms: float) -> Together[str] | None:
        return self.sync.tick(START + round(now_ms * MS), self.params)

    def upcoming(self, now_ms: float) -> Upcoming[str] | None:
        return self.sync.upcoming(START + round(now_ms * MS), self.params)


def at_ms(together: Together[str] | None) -> float | None:
    return None if together is None else (together.t_ns - START) / MS


def test_a_sweep_ticks_with_the_image_nearest_to_it() -> None:
    bench = Bench()
    for t in (0, 33, 66, 100, 133):
        bench.camera(t)
    bench.lidar(70, 135)
    together = bench.tick(135)
    assert together is not None
    assert at_ms(together) == 70
    assert together.image is not None
    assert together.image.value == "at 66"
    assert together.skew_ns == -4 * MS
    assert bench.tick(136) is None, "a tick is given once"


def test_60_hz_camera_against_10_hz_lidar_is_never_more_than_half_an_image_off() -> None:
    bench, skews = Bench(), []
    images = [5.0 + k * 1000 / 60 for k in range(180)]
    for k in range(1, 25):
        arrives = 100.0 * k + 51.0
        while images and images[0] <= arrives:
            bench.camera(images.pop(0))
        bench.lidar(100.0 * k, arrives)
        together = bench.tick(arrives)
        assert together is not None
        assert together.skew_ns is not None
        skews.append(abs(together.skew_ns) / MS)
    assert max(skews) <= 1000 / 60 / 2 + 0.01


@pytest.mark.parametrize(
    ("case", "image_ms", "max_skew_ms", "kept"),
    [
        ("inside the bound", 140.0, 60.0, True),
        ("outside the bound", 30.0, 60.0, False),
        ("bound widened", 30.0, 80.0, True),
    ],
)
def test_the_skew_is_bounded_and_said(case: str, image_ms: float, max_skew_ms: float, kept: bool) -> None:
    bench = Bench(params=SyncParams(max_skew_ms=max_skew_ms, wait_ms=0.0))
    bench.camera(image_ms)
    bench.lidar(100, 151)
    together = bench.tick(151)
    assert together is not None
    assert (together.image is not None) == kept
    assert (together.skew_ns is not None) == kept
    assert any("the nearest is -70 ms off" in note for note in together.notes) == (not kept)


def test_the_cameras_offset_moves_its_images_while_it_runs() -> None:
    bench = Bench()
    for t in (60, 93, 126, 160):
        bench.camera(t)
    bench.lidar(100, 160)
    bench.params = SyncParams(camera_offset_ms=-30.0)
    together = bench.tick(160)
    assert together is not None
    assert together.image is not None
    assert together.image.value == "at 126", "it was taken 30 ms before its stamp: at 96"
    assert together.skew_ns == -4 * MS


def test_a_sweep_waits_shortly_for_an_image_that_is_on_its_way() -> None:
    bench = Bench()
    bench.camera(70, 100)
    bench.lidar(105, 156)
    assert bench.tick(156) is None
    bench.camera(103, 160)
    assert bench.tick(160) is None, "one from after the sweep may be nearer still"
    bench.camera(136, 166)
    together = bench.tick(166)
    assert together is not None
    assert together.image is not None
    assert together.image.value == "at 103"


def test_a_sweep_does_not_wait_longer_than_it_may() -> None:
    bench = Bench()
    bench.camera(70, 100)
    bench.lidar(105, 156)
    assert bench.tick(156 + 24) is None
    together = bench.tick(156 + 26)
    assert together is not None
    assert together.image is not None


@pytest.mark.parametrize(
    ("case", "images", "now_ms", "expected"),
    [
        ("the next one will be nearer", (133, 166), 190, None),
        ("the next one will be farther away", (133, 166, 199), 200, "at 199"),
        ("one from after the sweep's time is there", (153, 186, 219), 220, "at 186"),
        ("nearest of several", (191, 202, 213), 217, "at 202"),
        ("a single image: nobody knows when the next one comes", (199,), 200, None),
        ("a single image from after the sweep's time", (201,), 202, "at 201"),
        ("too far away", (100, 130, 270), 271, None),
        ("no image", (), 200, None),
    ],
)
def test_the_image_of_the_next_sweep_is_known_before_it(
    case: str, images: tuple[float, ...], now_ms: float, expected: str | None
) -> None:
    bench = Bench()
    bench.lidar(0, 51)
    bench.tick(90)
    bench.lidar(100, 151)
    bench.tick(190)
    for t in images:
        bench.camera(t)
    known = bench.upcoming(now_ms)
    assert (known.image.value if known is not None else None) == expected, case
    if known is not None:
        assert known.t_ns == START + 200 * MS
        bench.lidar(200, 251)
        together = bench.tick(280)
        assert together is not None
        assert together.image == known.image, "that one"


def test_the_image_of_the_next_sweep_is_known_with_the_cameras_offset() -> None:
    bench = Bench(params=SyncParams(camera_offset_ms=-30.0))
    bench.lidar(0, 51)
    bench.lidar(100, 151)
    bench.tick(190)
    for t in (166, 199, 232):
        bench.camera(t)
    known = bench.upcoming(240)
    assert known is not None
    assert known.image.value == "at 232"


def test_no_next_sweep_is_expected_before_two_in_a_row_or_while_one_waits_or_from_a_silent_lidar() -> None:
    bench = Bench()
    for t in (-17, 17, 83, 117, 183, 217):
        bench.camera(t)
    assert bench.upcoming(218) is None, "no sweep"
    bench.lidar(0, 51)
    bench.tick(218)
    assert bench.upcoming(218) is None, "one sweep"
    bench.lidar(100, 151)
    assert bench.upcoming(218) is None, "a tick waits"
    bench.tick(218)
    assert bench.upcoming(218) is not None
    assert bench.upcoming(600) is None, "silent"


def test_without_a_camera_lidar_goes_on() -> None:
    bench = Bench()
    bench.lidar(100, 151)
    together = bench.tick(151)
    assert together is not None
    assert together.sweep is not None
    assert together.image is None


def test_without_lidar_the_camera_ticks() -> None:
    bench = Bench()
    for t in (0, 33, 66):
        bench.camera(t)
        together = bench.tick(t)
        assert together is not None
        assert at_ms(together) == t
        assert together.sweep is None
        assert together.skew_ns is None


def test_the_camera_takes_over_when_lidar_falls_silent_and_gives_back_when_it_returns() -> None:
    bench, ticked = Bench(), []
    arrivals = [("lidar", t, t + 51.0) for t in (100.0, 200.0, 300.0, 1200.0, 1300.0)]
    arrivals += [("camera", k * 33.3, k * 33.3) for k in range(45)]
    for kind, t, arrived in sorted(arrivals, key=lambda item: item[2]):
        (bench.lidar if kind == "lidar" else bench.camera)(t, arrived)
        together = bench.tick(arrived + 25.1)
        if together is not None:
            ticked.append((at_ms(together), "L" if together.sweep is not None else "C", arrived))
    times = [t for t, _, _ in ticked]
    assert times == sorted(set(times)), "time never runs back"
    kinds = "".join(kind for _, kind, _ in ticked)
    assert "LCCC" in kinds
    assert kinds.rstrip("L").endswith("C")
    first_camera = next(arrived for t, kind, arrived in ticked if kind == "C" and t > 300)
    assert first_camera - 351.0 < 400.0, "not longer than three periods and an image"
    assert ticked[-1][1] == "L"
    assert ticked[-1][2] - 1251.0 <= 101.0, "the LiDAR ticks again within a sweep of its return"


def test_ticks_that_nobody_took_are_replaced_and_counted() -> None:
    bench = Bench()
    for k in range(1, 6):
        bench.lidar(100 * k, 100 * k + 51)
    together = bench.tick(552)
    assert together is not None
    assert at_ms(together) == 500
    assert together.replaced == 4
    bench.lidar(600, 651)
    following = bench.tick(652)
    assert following is not None
    assert following.replaced == 0


@pytest.mark.parametrize(
    ("case", "t_ms", "now_ms", "taken", "counter"),
    [
        ("in order", 300, 300, True, None),
        ("the same once more", 200, 300, False, "duplicates"),
        ("overtaken on the way", 150, 300, True, "late"),
        ("a clock set to the future", 300 + 7000, 300, False, "implausible"),
        ("a clock set to the past", 300 - 7000, 300, False, "implausible"),
    ],
)
def test_a_stream_takes_what_can_be(case: str, t_ms: int, now_ms: int, taken: bool, counter: str | None) -> None:
    stream: SensorBuffer[int] = SensorBuffer()
    for t in (100, 200):
        assert stream.add(START + t * MS, t, START + t * MS)
    assert stream.add(START + t_ms * MS, 0, START + now_ms * MS) == taken
    assert {name: getattr(stream, name) for name in ("late", "duplicates", "implausible")} == {
        name: int(name == counter) for name in ("late", "duplicates", "implausible")
    }


def test_own_motion_is_the_nearest_and_not_an_old_one() -> None:
    bench = Bench()
    for t in (0, 100, 200):
        bench.sync.egos.add(START + t * MS, EgoState(START + t * MS, t / 10.0), START + t * MS)
    bench.lidar(120, 171)
    together = bench.tick(171)
    assert together is not None
    assert together.ego is not None
    assert together.ego.speed_mps == 10.0
    bench.lidar(900, 951)
    later = bench.tick(951)
    assert later is not None
    assert later.ego is None


@pytest.mark.parametrize("rate_hz", [1, 2, 5, 10])
def test_own_motion_holds_until_its_receiver_speaks_again(rate_hz: int) -> None:
    """Fixes arrive 120 ms late; then the receiver falls silent, and its last value does not hold any longer."""
    bench, period_ms = Bench(), 1000 // rate_hz
    fixes = list(range(0, 6000, period_ms))
    for t in range(200, fixes[-1] + 3000, 100):
        while fixes and fixes[0] + 120 <= t:
            at_ns = START + fixes[0] * MS
            bench.sync.egos.add(at_ns, EgoState(at_ns, 20.0), at_ns + 120 * MS)
            last_ms = fixes.pop(0)
        bench.lidar(t, t + 51)
        together = bench.tick(t + 51)
        assert together is not None
        assert (together.ego is not None) == (t - last_ms <= max(1.5 * period_ms, 500)) or t < 1500


@given(st.lists(st.tuples(st.integers(0, 3000), st.booleans(), st.integers(0, 200)), max_size=60))
def test_whatever_arrives_in_whatever_order_ticks_go_forward(messages: list[tuple[int, bool, int]]) -> None:
    bench, last = Bench(), -1.0
    for t, is_lidar, delay in sorted(messages, key=lambda item: item[0] + item[2]):
        (bench.lidar if is_lidar else bench.camera)(t, t + delay)
        together = bench.tick(t + delay)
        if together is not None:
            now = at_ms(together)
            assert now is not None
            assert now > last
            assert together.skew_ns is None or abs(together.skew_ns) <= bench.params.max_skew_ms * MS
            last = now
