"""What the paper's braking manoeuvres come to in the loop."""

from __future__ import annotations

import pytest

from pipeline.common.fast_replace import evolve
from pipeline.experiments.paper.braking import BrakingCase, cases, report, run
from pipeline.experiments.paper.closed_forms import PAPER


def test_towards_a_standing_car_both_sensors_brake_earlier_than_the_lidar() -> None:
    cases = [BrakingCase("CCRs", sensors, "ACC + AEB", 0) for sensors in ("lidar", "both")]
    lidar, fused = (run(case) for case in cases)
    assert lidar.acquired_m is not None
    assert fused.acquired_m is not None
    assert fused.acquired_m > lidar.acquired_m + 15.0
    assert (fused.impact_mps or 0.0) < (lidar.impact_mps or 0.0)
    assert lidar.peak_decel_mps2() == pytest.approx(8.0, abs=0.1)
    section = report(cases, [lidar, fused])
    assert "better than the LiDAR alone" in section.text[1]


def test_the_same_case_gives_the_same_drive() -> None:
    case = BrakingCase("CCRb", "both", "ACC + AEB", 3)
    assert run(case) == run(case)


def test_with_the_embedded_network_in_the_loop_it_stops_behind_a_braking_lead() -> None:
    drive = run(BrakingCase("CCRb", "both", "ACC + AEB", 0, "network"))
    assert drive.acquired_m is not None
    assert drive.impact_mps is None
    assert drive.speed_mps[-1] < 0.1
    assert {"partial_brake", "full_brake"} & set(drive.states)


def test_the_column_of_boxes_says_which_runs_had_the_network() -> None:
    full = cases(False)
    assert {case.manoeuvre for case in full if case.boxes == "network"} == set(PAPER)
    drive = run(BrakingCase("CCRb", "lidar", "ACC", 0))
    section = report([BrakingCase("CCRb", "both", "ACC + AEB", 0, "network"), *_pair()], [drive] * 3)
    assert [row[3] for row in section.tables[0].rows] == ["network", None, "truth"]


def test_what_differs_by_centimetres_is_no_better() -> None:
    drive = run(BrakingCase("CCRb", "lidar", "ACC + AEB", 0))
    nearly = evolve(drive, gap_m=tuple(gap + 0.02 for gap in drive.gap_m))
    clearly = evolve(drive, gap_m=tuple(gap + 2.0 for gap in drive.gap_m))
    assert "no better than" in report(_pair(), [drive, nearly]).text[1]
    assert "no better than" not in report(_pair(), [drive, clearly]).text[1]


def _pair() -> list[BrakingCase]:
    return [BrakingCase("CCRb", "lidar", "ACC + AEB", 0), BrakingCase("CCRb", "both", "ACC + AEB", 0)]
