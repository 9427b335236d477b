"""A closed-loop drive kept as a scenario: the same moments, the same sweeps, the same results."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Never

import numpy as np
import pytest

from pipeline.detection import Detectors
from pipeline.params import Params
from pipeline.run import Sensors, run
from pipeline.simulation.closed_loop import Setup, drive
from pipeline.simulation.drive_as_scenario import as_driven, to_yaml
from pipeline.simulation.scenario import Scenario, load, parse
from pipeline.simulation.sensors.detection_model import BoxNoise, Detections
from pipeline.sources import open_source
from pipeline.sources.simulated import truth_of
from pipeline.types import U8, Result
from pipeline.types.result_json import to_json

TICKS = 25


@pytest.fixture(scope="module")
def braking() -> Scenario:
    """Approaching a standing car: the closed loop brakes, unlike the script."""
    return load("ccrs_100")


def believed(result: Result) -> dict[str, Any]:
    """The result without timings, and without differences due to the replay's image."""
    return {key: value for key, value in to_json(result).items() if key not in ("timing_ms", "sensors")}


class Unwanted:
    """A detector that must not be called."""

    name, notes = "unwanted", ()

    def detect(self, bgr: U8) -> Never:
        pytest.fail("it was asked to look at an image")


@pytest.mark.parametrize("sensors", ["lidar", "camera", "both"])
def test_a_kept_drive_gives_the_very_frames_and_results_of_the_loop(
    braking: Scenario, sensors: Sensors, tmp_path: Path
) -> None:
    ticks = [tick for tick, _ in zip(drive(braking, Setup(sensors=sensors)), range(TICKS), strict=False)]
    kept = as_driven(braking, [tick.vehicle.motion() for tick in ticks])
    kept = kept.model_copy(update={"sensors": sensors, "detections": Detections(boxes=BoxNoise())})
    file = tmp_path / "drive.yaml"
    file.write_text(to_yaml(kept, "a drive"))
    source = open_source(f"sim:{file}")
    assert len(source) == TICKS
    assert source.notes
    given = Detectors(Unwanted(), Unwanted())
    for index, (tick, (frame, result)) in enumerate(zip(ticks, run(source, Params(), given), strict=True)):
        assert frame.image is not None
        if tick.frame.sweep is None:
            assert frame.sweep is None
        else:
            assert frame.sweep is not None
            np.testing.assert_array_equal(frame.sweep.points, tick.frame.sweep.points)
        assert believed(result) == believed(tick.result)
        assert source.truth(index) == truth_of(tick.world, kept.road)


def test_the_drive_is_not_the_script(braking: Scenario) -> None:
    ticks = [tick for tick, _ in zip(drive(braking, Setup()), range(60), strict=False)]
    kept = as_driven(braking, [tick.vehicle.motion() for tick in ticks])
    assert kept.own_motion(5.9).speed_mps == pytest.approx(ticks[-1].vehicle.speed_mps, abs=1e-6)
    assert abs(kept.own_motion(5.9).speed_mps - braking.own_motion(5.9).speed_mps) > 0.1


def test_between_two_ticks_the_motion_is_in_proportion_and_it_stays_at_the_end(braking: Scenario) -> None:
    row = (0.0, -1.75, 10.0, 0.0, 0.0, 0.0)
    kept = braking.model_copy(update={"driven": (row, (1.0, -1.75, 12.0, 2.0, 0.0, 0.0))})
    assert kept.own_motion(0.05).speed_mps == pytest.approx(11.0)
    assert kept.own_motion(9.0).travelled_m == 1.0


def test_what_is_written_is_read_back_whole(braking: Scenario) -> None:
    kept = as_driven(braking, [braking.own_motion(k / 10) for k in range(5)], "as driven")
    assert parse(to_yaml(kept), "kept.yaml") == kept
