"""The CIPV in a street without paint: by the yaw rate alone, with other vehicles, and with the road's edges."""

from __future__ import annotations

import pytest

from pipeline.experiments.curves.drives import driven
from pipeline.experiments.curves.experiment import longest_wrong_s, share_right
from pipeline.experiments.streets.experiment import NEITHER, SETTINGS, STREETS, WITH, WITHOUT
from pipeline.experiments.streets.scenarios import CORNER_M, Street, StreetBorder, scenario


def test_between_hedges_in_bends_of_50_m_the_lead_is_the_cipv_by_edges_and_vehicles() -> None:
    (case,) = STREETS.cases(True)
    outcome = STREETS.run(case)
    share, frames = share_right([outcome[WITH]])
    assert frames > 120
    assert share >= 0.7
    assert longest_wrong_s(outcome[WITH]) <= 0.3
    assert share_right([outcome[NEITHER]])[0] < 0.4, "the street is hard without them"
    assert share_right([outcome[WITHOUT]])[0] > share_right([outcome[NEITHER]])[0]
    (table,) = STREETS.report([case], [outcome]).tables
    assert [row[2] for row in table.rows] == [NEITHER, NEITHER, WITHOUT, WITHOUT, WITH, WITH]


@pytest.mark.parametrize(
    ("beside", "unaware", "right", "without"),
    [
        pytest.param(
            "hedges", {"existence.use_missing_boxes": False, "cipv.become_standing": 0.5}, 0.99, 0.97, id="hedges"
        ),
        pytest.param("parked", {}, 0.85, 0.8, id="parked cars"),
    ],
)
def test_at_a_corner_nothing_leads(
    beside: StreetBorder, unaware: dict[str, object], right: float, without: float
) -> None:
    """What stands across the street is straight ahead until the car turns; a hedge there comes into view bit by bit, as
    if it moved."""
    scene, edges = scenario(Street(CORNER_M, beside, "nothing"), 0), SETTINGS[WITH]
    settings = {"as it is": edges, "unaware": {**edges, "path.use_corners": False, **unaware}}
    outcome = driven(scene, 40.0, tuple(settings), settings=settings, lines=None)
    assert share_right([outcome["as it is"]])[0] >= right
    assert share_right([outcome["unaware"]])[0] < without


def test_the_report_tells_corners_from_bends() -> None:
    groups = {(case.street.radius_m, case.street.ahead) for case in STREETS.cases(False)}
    assert (CORNER_M, "nothing") in groups
    assert (CORNER_M, "lead") not in groups, "around the corner, nobody sees the lead"
    assert len(groups) == 9
