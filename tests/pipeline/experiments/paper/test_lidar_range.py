"""The LiDAR range check on two runs: near it is exact, far it is blind."""

from __future__ import annotations

from pipeline.experiments.paper.lidar_range import (
    PRINTED,
    RangeCase,
    RangeSample,
    as_drive,
    recognised_to_m,
    report,
    run,
)
from tests.pipeline.experiments.conftest import SeeAgain


def test_near_it_is_exact_and_far_it_is_blind(see_again: SeeAgain) -> None:
    cases = [RangeCase("car", 0), RangeCase("car", 1)]
    runs = [run(case) for case in cases]
    for sightings in runs:
        assert sightings[0].true_m > 95.0
        near = [each for each in sightings if each.true_m < 20.0]
        assert sum(each.measured_m is not None for each in near) > 0.9 * len(near)
        assert all(abs(each.measured_m - each.true_m) < 1.0 for each in near if each.measured_m is not None)
        far = [each for each in sightings if each.true_m > 85.0]
        assert sum(each.measured_m is not None for each in far) < 0.2 * len(far)
    again = see_again(as_drive(cases[0], runs[0]), 75)
    in_lane = [[item.distance_m for item in result.objects if item.in_path and not item.carried] for result in again]
    measured = [[each.measured_m] if each.measured_m is not None else [] for each in runs[0][:75]]
    assert in_lane == measured, "seen again, the LiDAR alone measures the same"
    assert sum(map(len, in_lane)) > 5
    paper, car = report(cases, runs).tables[0].rows
    assert paper[1] == PRINTED["mean error %"] == 2.14
    assert car[0] == "car"
    assert isinstance(car[4], float)
    assert 20.0 <= car[4] <= 60.0


def test_the_limit_is_the_first_bin_that_holds_too_little_coming_from_near() -> None:
    def sweeps(low: int, high: int, every: int) -> list[RangeSample]:
        return [RangeSample(d / 10, d / 10 if d % every == 0 else None) for d in range(low * 10, high * 10)]

    assert recognised_to_m(sweeps(5, 30, 1) + sweeps(30, 100, 3)) == 30.0
    assert recognised_to_m(sweeps(5, 10, 3) + sweeps(10, 40, 1)) is None, "blind near: nothing is recognised"
    assert recognised_to_m(sweeps(5, 20, 1) + sweeps(20, 30, 4) + sweeps(30, 40, 1)) == 20.0, "a hole ends it"
