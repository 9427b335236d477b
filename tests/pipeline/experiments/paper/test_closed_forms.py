"""What the paper prints comes out of its formula; physics says otherwise."""

from __future__ import annotations

import pytest

from pipeline.experiments.paper.closed_forms import (
    PAPER,
    Manoeuvre,
    closed_forms,
    needed_behind_braking_mps2,
    needed_decel_mps2,
    printed_decel_mps2,
)
from pipeline.experiments.straight_track import KMH


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
