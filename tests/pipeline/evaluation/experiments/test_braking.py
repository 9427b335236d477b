"""The paper's closed forms, and what its braking manoeuvres come to in the loop."""

from __future__ import annotations

import pytest

from pipeline.evaluation.experiments.braking import (
    KMH,
    PAPER,
    Case,
    Manoeuvre,
    cases,
    closed_forms,
    needed_behind_braking_mps2,
    needed_decel_mps2,
    printed_decel_mps2,
    report,
    run,
)
from pipeline.records import evolve


@pytest.mark.parametrize("manoeuvre", list(PAPER))
def test_the_printed_decelerations_come_out_of_the_printed_formula(manoeuvre: Manoeuvre) -> None:
    paper = PAPER[manoeuvre]
    speed, end = paper.speed_kmh * KMH, paper.end_kmh * KMH
    assert printed_decel_mps2(speed, end, paper.lidar_m, paper.keep_m) == pytest.approx(paper.lidar_mps2, abs=0.005)
    assert printed_decel_mps2(speed, end, paper.fused_m, paper.keep_m) == pytest.approx(paper.fused_mps2, abs=0.005)


@pytest.mark.parametrize(("detected_m", "printed", "physics"), [(35.0, 5.401, 2.31), (60.0, 2.025, 0.87)])
def test_closing_on_a_moving_lead_needs_far_less_than_printed(
    detected_m: float, printed: float, physics: float
) -> None:
    paper = PAPER["CCRm"]
    assert printed in (paper.lidar_mps2, paper.fused_mps2)
    needed = needed_decel_mps2((paper.speed_kmh - paper.end_kmh) * KMH, detected_m, paper.keep_m)
    assert needed == pytest.approx(physics, abs=0.01)


def test_behind_a_braking_lead_its_own_way_counts() -> None:
    speed = 50.0 * KMH
    standing = needed_decel_mps2(speed, 50.0, 10.0)
    braking = needed_behind_braking_mps2(speed, speed, 6.0, 50.0, 10.0)
    assert standing == pytest.approx(2.411, abs=0.001)
    assert braking == pytest.approx(speed**2 / (2 * (40.0 + speed**2 / 12.0)))


def test_the_table_shows_print_formula_and_physics() -> None:
    table = closed_forms()
    for row in table.rows:
        assert row[5] == pytest.approx(row[4], abs=0.005)
    assert [row[0] for row in table.rows if row[6] != pytest.approx(row[5], rel=0.01)] == ["CCRm"] * 2 + ["CCRb"] * 2


def test_towards_a_standing_car_both_sensors_brake_earlier_than_the_lidar() -> None:
    cases = [Case("CCRs", sensors, "ACC + AEB", 0) for sensors in ("lidar", "both")]
    lidar, fused = (run(case) for case in cases)
    assert lidar.acquired_m is not None
    assert fused.acquired_m is not None
    assert fused.acquired_m > lidar.acquired_m + 15.0
    assert (fused.impact_mps or 0.0) < (lidar.impact_mps or 0.0)
    assert lidar.peak_decel_mps2() == pytest.approx(8.0, abs=0.1)
    section = report(cases, [lidar, fused])
    assert "better than the LiDAR alone" in section.text[1]


def test_the_same_case_gives_the_same_drive() -> None:
    case = Case("CCRb", "both", "ACC + AEB", 3)
    assert run(case) == run(case)


def test_with_the_embedded_network_in_the_loop_it_stops_behind_a_braking_lead() -> None:
    drive = run(Case("CCRb", "both", "ACC + AEB", 0, "network"))
    assert drive.acquired_m is not None
    assert drive.impact_mps is None
    assert drive.speed_mps[-1] < 0.1
    assert "full_brake" in drive.states


def test_the_column_of_boxes_says_which_runs_had_the_network() -> None:
    full = cases(False)
    assert {case.manoeuvre for case in full if case.boxes == "network"} == set(PAPER)
    drive = run(Case("CCRb", "lidar", "ACC", 0))
    section = report([Case("CCRb", "both", "ACC + AEB", 0, "network"), *_pair()], [drive] * 3)
    assert [row[3] for row in section.tables[0].rows] == ["network", None, "truth"]


def test_what_differs_by_centimetres_is_no_better() -> None:
    drive = run(Case("CCRb", "lidar", "ACC + AEB", 0))
    nearly = evolve(drive, gap_m=tuple(gap + 0.02 for gap in drive.gap_m))
    clearly = evolve(drive, gap_m=tuple(gap + 2.0 for gap in drive.gap_m))
    assert "no better than" in report(_pair(), [drive, nearly]).text[1]
    assert "no better than" not in report(_pair(), [drive, clearly]).text[1]


def _pair() -> list[Case]:
    return [Case("CCRb", "lidar", "ACC + AEB", 0), Case("CCRb", "both", "ACC + AEB", 0)]
