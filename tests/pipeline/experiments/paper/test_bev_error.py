"""Fused objects are where the target is; the LiDAR's are nearer to it than the camera's."""

from __future__ import annotations

import pytest

from pipeline.experiments.paper.bev_error import (
    PRINTED,
    BevCase,
    PositionError,
    PositionSample,
    as_drive,
    cases,
    report,
    run,
)
from tests.pipeline.experiments.conftest import SeeAgain


def test_errors_are_small_near_honest_far_and_stand_beside_the_print(see_again: SeeAgain) -> None:
    cases = [BevCase("a", 0, "lidar"), BevCase("a", 0), BevCase("b", 0)]
    runs = [run(case) for case in cases]
    section = report(cases, runs)
    rows = {(row[0], row[1], row[2]): row[3:] for row in section.tables[0].rows}
    fused = rows["straight ahead", "VL", "measured"]
    camera = rows["straight ahead", "V", "measured"]
    assert isinstance(fused[0], int)
    assert fused[0] > 10
    assert 0.0 < fused[4] < 0.6, "VL: mean distance error in metres"  # type: ignore[operator]
    assert 0.3 < camera[4] < 6.0, "V: not the quarter of a metre that is printed"  # type: ignore[operator]
    assert rows["straight ahead", "V", "printed"][2:] == PRINTED["a", "V"]
    assert rows["two lanes left", "VL", "measured"][2:] == (None,) * 9, "not driven: no figures"
    assert len(section.scenes) == 3
    left = rows["one lane left", "VL", "measured"]
    assert left[7] < 1.0, "lateral mean: the car is in its own lane"  # type: ignore[operator]
    assert any(
        "fused locates the car in" in text and "better than the LiDAR alone with" in text for text in section.text
    )
    again = see_again(as_drive(cases[1], runs[1]), 50)
    seen = {each.range_m + each.error.distance_m for each in runs[1] if each.error is not None}
    believed = [item.distance_m for result in again for item in result.objects if item.source == "VL"]
    assert len(believed) > 5
    assert all(distance == pytest.approx(min(seen, key=lambda m: abs(m - distance))) for distance in believed)


def test_the_lidar_alone_is_driven_and_the_network_too() -> None:
    kinds = {(case.sensors, case.boxes) for case in cases(False)}
    assert kinds == {("both", "truth"), ("lidar", "truth"), ("both", "network")}
    assert {case.sensors for case in cases(True)} == {"both", "lidar"}


@pytest.mark.parametrize(
    ("fused_m", "lidar_m", "says"),
    [(0.1, 0.3, ("better", "better")), (0.3, 0.3, ("better", "no better")), (None, 0.3, ("no better", None))],
)
def test_the_verdict_is_what_was_measured(fused_m: float | None, lidar_m: float, says: tuple[str, str | None]) -> None:
    """At 20 m, both place the object, or the LiDAR alone; at 50 m, only fused, or none."""
    near = PositionError("VL", fused_m, 0.0, 0.0) if fused_m is not None else None
    far = PositionError("V", 2.0, 0.0, 0.0) if fused_m is not None else None
    fused = [
        PositionSample(20.0, near),
        PositionSample(20.0, PositionError("VL", fused_m or 0.2, 0.0, 0.0)),
        PositionSample(50.0, far),
    ]
    lidar = [
        PositionSample(20.0, PositionError("L", lidar_m, 0.0, 0.0)),
        PositionSample(20.0, PositionError("L", lidar_m, 0.0, 0.0)),
    ]
    text = report([BevCase("a", 0), BevCase("a", 0, "lidar")], [fused, [*lidar, PositionSample(50.0, None)]]).text
    (verdict,) = (each for each in text if each.startswith("Straight ahead: fused locates"))
    assert f"frames, {says[0]} than the LiDAR alone with" in verdict
    assert says[1] is None or f" m, {says[1]} than the LiDAR alone with" in verdict
    assert f"{'1' if fused_m is None else '3'} of 3 frames" in verdict


def test_however_far_off_it_counts() -> None:
    """An object placed 20 m too far and 6 m to the side has errors of 20 m and 6 m; it does not count as another
    object."""
    seen = [PositionSample(50.0, PositionError("V", 20.0, 6.0, 19.0)), PositionSample(40.0, None)]
    row = report([BevCase("a", 0)], [seen]).tables[0].rows[3]
    assert row[3:5] == (1, 1)
    assert row[6] == 20.0
    assert row[9] == 6.0
