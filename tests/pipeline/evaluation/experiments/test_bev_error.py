"""Fused objects are where the target is; the LiDAR's are nearer to it than the camera's."""

from __future__ import annotations

from pipeline.evaluation.experiments.bev_error import PRINTED, Case, report, run


def test_errors_are_small_near_honest_far_and_stand_beside_the_print() -> None:
    cases = [Case("a", 0), Case("b", 0)]
    runs = [run(case) for case in cases]
    section = report(cases, runs)
    rows = {(row[0], row[1], row[2]): row[3:] for row in section.tables[0].rows}
    fused = rows["straight ahead", "VL", "measured"]
    camera = rows["straight ahead", "V", "measured"]
    assert isinstance(fused[0], int)
    assert fused[0] > 10
    assert 0.0 < fused[3] < 0.6, "VL: mean distance error in metres"  # type: ignore[operator]
    assert 0.3 < camera[3] < 6.0, "V: not the quarter of a metre that is printed"  # type: ignore[operator]
    assert rows["straight ahead", "V", "printed"][1:] == PRINTED["a", "V"]
    assert rows["two lanes left", "VL", "measured"][1:] == (None,) * 9, "not driven: no figures"
    left = rows["one lane left", "VL", "measured"]
    assert left[6] < 1.0, "lateral mean: the car is in its own lane"  # type: ignore[operator]
