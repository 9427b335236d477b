"""The CIPV in a street without paint: one drive by the yaw rate alone, with other vehicles, and with the road's edges."""

from __future__ import annotations

from pipeline.experiments.curves.experiment import longest_wrong_s, share_right
from pipeline.experiments.streets.experiment import NEITHER, STREETS, WITH, WITHOUT


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
