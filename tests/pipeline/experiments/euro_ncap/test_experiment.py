"""The grid has every cell, a bad approach is void, and each run has its cell in the report."""

from __future__ import annotations

import pytest

from pipeline.evaluation.report_sections import Coloured
from pipeline.experiments.euro_ncap.drives import (
    OVERLAPS,
    SETUPS,
    CellResult,
    EuroNcapCase,
    NcapTest,
    as_drive,
    cases,
    run,
)
from pipeline.experiments.euro_ncap.experiment import report


@pytest.mark.parametrize(("test", "speeds"), [("CCRs", range(10, 81, 5)), ("CCRm", range(30, 81, 5))])
def test_the_grid_is_the_protocols(test: NcapTest, speeds: range) -> None:
    mine = [case for case in cases(False) if case.test == test and case.kind == SETUPS[0]]
    assert {(case.speed_kmh, case.overlap) for case in mine} == {(float(v), o) for v in speeds for o in OVERLAPS}


def test_a_braking_lead_brakes_twice_as_hard_from_two_gaps() -> None:
    mine = {(case.decel_mps2, case.gap_m) for case in cases(False) if case.test == "CCRb"}
    assert mine == {(2.0, 12.0), (2.0, 40.0), (6.0, 12.0), (6.0, 40.0)}


def test_aeb_avoids_a_standing_car_at_40_and_without_brakes_there_is_an_impact() -> None:
    fused = EuroNcapCase("CCRs", 40.0, 100, "both", "AEB")
    assert run(fused) == CellResult(0.0, "")
    blind = run(EuroNcapCase("CCRs", 80.0, 100, "lidar", "AEB"))
    assert not blind.void
    assert 5.0 < blind.impact_kmh < 80.0, "too fast for the LiDAR's reach, but braked"


def test_the_network_drives_a_sample_of_the_grid_and_every_drive_has_a_name_of_its_own() -> None:
    every = cases(False)
    truth = {(case.test, case.speed_kmh, case.overlap, case.gap_m) for case in every if case.boxes == "truth"}
    sample = [case for case in every if case.boxes == "network"]
    assert len(sample) == 10
    assert all((case.test, case.speed_kmh, case.overlap, case.gap_m) in truth for case in sample)
    assert len({case.name for case in every}) == len(every)


def test_a_cell_can_be_driven_again_as_it_was() -> None:
    case = EuroNcapCase("CCRs", 40.0, 100, "both", "AEB")
    result = run(case)
    kept = as_drive(case, result)
    assert result.drive is not None
    assert len(kept.scenario.driven) == len(result.drive.speed_mps)
    assert kept.scenario.driven[-1][2] == pytest.approx(result.drive.speed_mps[-1], abs=1e-6)
    assert "avoided" in kept.text[0]


def test_a_car_that_brakes_before_the_start_makes_the_run_void() -> None:
    assert run(EuroNcapCase("CCRb", 50.0, 100, "both", "ACC", 12.0, 2.0)).void == "braked before the start"


def test_the_report_has_a_coloured_cell_for_each_run() -> None:
    chosen = [
        EuroNcapCase("CCRs", 30.0, overlap, sensors, "AEB") for sensors in ("both", "lidar") for overlap in (-50, 100)
    ]
    section = report(
        chosen, [CellResult(0.0, ""), CellResult(8.0, ""), CellResult(30.0, ""), CellResult(0.0, "speed off")]
    )
    grids = {table.title: table.rows for table in section.tables}
    assert grids["CCRs: fused, AEB"] == (
        (
            "30 km/h",
            Coloured(0.0, "green", "ccrs_30kmh_overlap-50_fused_aeb_truth"),
            Coloured(8.0, "brown", "ccrs_30kmh_overlap100_fused_aeb_truth"),
        ),
    )
    ((_, *lidar),) = grids["CCRs: LiDAR, AEB"]
    assert [(cell.value, cell.tone) for cell in lidar] == [(30.0, "red"), ("speed off", "grey")]
    assert "of 1 runs fused ends slower than the LiDAR alone in 1" in section.text[1], "a void run does not count"
