"""A camera that is late is found to some milliseconds, simulated and real; a standing car tells nothing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from pipeline.calibration.time_offset import NoOffset, time_offset, watch
from pipeline.calibration.times import times_of
from pipeline.common.fast_replace import evolve
from pipeline.params import Params
from pipeline.simulation.scenario import load
from pipeline.simulation.sensors.rig import SensorRig
from pipeline.simulation.world import world_state
from pipeline.sources import open_source
from pipeline.types import Frame

FRAMES = 60
LATER_MS = 35.0


def drive(later_ms: float) -> Callable[[int], Frame]:
    """Frames of a bend whose images were taken later than their timestamps, by this delay."""
    scene = load("curve_125")
    sensors = SensorRig(scene, world_state.at(scene, scene.duration_s).s_m)

    def frame(index: int) -> Frame:
        t_s = index / scene.rate_hz
        now, then = (world_state.at(scene, t_s + ms / 1e3) for ms in (0.0, later_ms))
        t_ns = round(1e9 * t_s)
        image = sensors.frame(then, index, t_ns).image
        return evolve(sensors.frame(now, index, t_ns, image=False), image=image)

    return frame


@pytest.fixture(scope="module")
def late() -> list[Frame]:
    frame = drive(LATER_MS)
    return [frame(index) for index in range(FRAMES)]


def test_a_camera_whose_images_are_later_than_they_say_is_found(late: list[Frame]):
    scenes, speeds = watch(late.__getitem__, FRAMES, Params())
    found = time_offset(scenes)
    assert found.camera_offset_ms == pytest.approx(LATER_MS, abs=5.0)
    assert abs(found.camera_offset_ms - LATER_MS) < 4.0 * found.sigma_ms
    assert found.frames >= 50
    assert len(speeds) > 40
    times = times_of(scenes, speeds)
    assert times.camera == found
    assert times.changes == {"sync.camera_offset_ms": found.camera_offset_ms}
    assert any("ego speed" in each for each in times.warnings), "six seconds at one speed"
    again = times_of(scenes, speeds, recorded_ms=20.0)
    assert again.changes == {"sync.camera_offset_ms": round(found.camera_offset_ms + 20.0, 1)}, "its images say so"


def test_times_that_say_so_leave_nothing_to_correct(late: list[Frame]):
    def stamped(index: int) -> Frame:
        image = late[index].image
        assert image is not None
        return replace(late[index], image=replace(image, t_ns=late[index].t_ns + int(LATER_MS * 1e6)))

    assert time_offset(watch(stamped, FRAMES, Params())[0]).camera_offset_ms == pytest.approx(0.0, abs=5.0)


def test_a_small_yaw_of_the_mount_is_not_taken_for_time(late: list[Frame]):
    turned = Params().model_copy(update={"alignment": Params().alignment.model_copy(update={"yaw_deg": 0.6})})
    assert time_offset(watch(late.__getitem__, FRAMES, turned)[0]).camera_offset_ms == pytest.approx(LATER_MS, abs=8.0)


def test_a_standing_car_and_images_of_other_frames_tell_nothing(late: list[Frame]):
    def standing(index: int) -> Frame:
        return replace(late[0], t_ns=late[index].t_ns, ego=replace(late[0].ego, speed_mps=0.0, yaw_rate_radps=0.0))

    scenes, speeds = watch(standing, FRAMES, Params())
    with pytest.raises(NoOffset, match="while the car drives"):
        time_offset(scenes)
    with pytest.raises(NoOffset, match=r"while the car drives.*ego speed"):
        times_of(scenes, speeds)
    mixed = [replace(frame, image=late[(k * 7 + 23) % FRAMES].image) for k, frame in enumerate(late)]
    with pytest.raises(NoOffset, match="stands out as the best match"):
        time_offset(watch(mixed.__getitem__, FRAMES, Params())[0])


def test_real_images_of_the_next_frame_are_one_frame_late(data_dir: Path):
    source = open_source(f"kitti:{data_dir / 'kitti_0009' / '2011_09_26' / '2011_09_26_drive_0009_sync'}")
    frames = [source.frame(index) for index in range(len(source))]

    def shifted(by: int) -> float:
        def frame(index: int) -> Frame:
            own, other = frames[index + 1], frames[index + 1 + by].image
            assert own.image is not None
            assert other is not None
            return replace(own, image=replace(other, t_ns=own.image.t_ns))

        return time_offset(watch(frame, len(frames) - 2, Params())[0]).camera_offset_ms

    step_ms = (frames[-1].t_ns - frames[0].t_ns) / 1e6 / (len(frames) - 1)
    asis, later = shifted(0), shifted(1)
    assert abs(asis) < 20.0
    assert later - asis == pytest.approx(step_ms, abs=5.0)
