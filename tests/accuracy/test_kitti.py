"""A 64-channel drive cut down to a VLP-16's rings: slowing behind a lead in traffic."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.accuracy.drives import drive


def test_the_lead_is_the_cipv_in_every_frame_under_one_number(data_dir: Path) -> None:
    results = drive(data_dir, "kitti").results
    assert len(results) == 23
    leads = {name: result.cipv for name, result in results.items()}
    assert all(leads.values()), [name for name, lead in leads.items() if lead is None]
    assert len({lead.id for lead in leads.values() if lead}) == 1, {n: lead.id for n, lead in leads.items() if lead}


@pytest.mark.parametrize("frame", ["0000000007", "0000000014", "0000000021"])
def test_distance_is_that_of_the_labels_nearest_face(data_dir: Path, frame: str) -> None:
    verdict = drive(data_dir, "kitti").judged[frame]
    assert verdict.verdict == "correct"
    assert verdict.error_m == pytest.approx(0.0, abs=0.3)
