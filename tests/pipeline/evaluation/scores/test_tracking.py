"""trackeval's figures on examples small enough to count by hand."""

from __future__ import annotations

from dataclasses import replace
from math import sqrt

import pytest

pytest.importorskip("trackeval", reason="the extra `scores` is not installed")

from pipeline.evaluation.scores import tracking
from pipeline.evaluation.scores.figures import FIGURES
from pipeline.evaluation.scores.matching import claims, vehicles
from pipeline.evaluation.scores.tracking import Counts, NamedPositions, count, hota_of
from tests.pipeline.build import fused
from tests.pipeline.evaluation.scores.drives import believed, labelled

A, B = (20.0, 0.0), (30.0, 3.5)


def counted(truths: list[NamedPositions], found: list[NamedPositions]) -> Counts:
    counts = count(truths, found)
    assert counts is not None
    return counts


def ratios(counts: Counts) -> dict[str, float]:
    sums = {
        "precision": tracking.precision_sums,
        "recall": tracking.recall_sums,
        "mota": tracking.mota_sums,
        "idf1": tracking.idf1_sums,
    }
    return {name: of(counts)[0] / of(counts)[1] for name, of in sums.items()}


TRUTH: list[NamedPositions] = [[(1, A), (2, B)]] * 4


@pytest.mark.parametrize(
    ("found", "precision", "recall", "mota", "idf1"),
    [
        pytest.param([[(5, A), (6, B)]] * 4, 1.0, 1.0, 1.0, 1.0, id="perfect"),
        pytest.param([[(5, A)]] * 4, 1.0, 0.5, 0.5, 8 / 12, id="one never found"),
        pytest.param([[(5, A), (6, B), (7, (40.0, -5.0))]] * 4, 8 / 12, 1.0, 0.5, 16 / 20, id="one that is not there"),
        # 2 × IDTP = 2 × (4 + 2) of 8 there and 8 claimed; one switch in eight
        pytest.param([[(5, A), (6, B)]] * 2 + [[(5, A), (7, B)]] * 2, 1.0, 1.0, 7 / 8, 12 / 16, id="a new number"),
    ],
)
def test_counts(found: list[NamedPositions], precision: float, recall: float, mota: float, idf1: float) -> None:
    expected = {"precision": precision, "recall": recall, "mota": mota, "idf1": idf1}
    assert ratios(counted(TRUTH, found)) == pytest.approx(expected)


def test_hota_of_a_track_that_breaks_in_half() -> None:
    """DetA 1; each of the four matches shares its association with 2 and misses 2: AssA = 2/4."""
    counts = counted([[(1, A)]] * 4, [[(5, A)]] * 2 + [[(6, A)]] * 2)
    assert hota_of([counts]) == pytest.approx(sqrt(1.0 * 0.5))


def test_two_metres_are_one_place_and_more_are_two() -> None:
    near = counted([[(1, A)]], [[(5, (21.9, 0.0))]])
    far = counted([[(1, A)]], [[(5, (22.1, 0.0))]])
    assert tracking.recall_sums(near) == (1, 1)
    assert tracking.recall_sums(far) == (0, 1)


def test_drives_are_summed_not_averaged() -> None:
    whole, none = counted(TRUTH, [[(5, A), (6, B)]] * 4), counted([[(1, A)]], [[]])
    hota = hota_of([whole, none])
    assert hota == pytest.approx(sqrt(8 / 9))
    assert hota_of([]) is None


def test_what_claims_to_be_a_vehicle() -> None:
    """Classified and confirmed objects do; an unclassified one only if a labelled vehicle has no classified one."""
    wanted = vehicles([labelled(1, *A), labelled(2, *B), labelled(3, 10.0, 2.0, "person"), labelled(4, 80.0)])
    assert [item.id for item in wanted] == [1, 2]
    objects = [
        fused(1, *A),
        fused(2, 20.5, 0.5, source="L"),  # the same car: it has a named object
        fused(3, 30.5, 3.5, source="L"),  # the other car
        fused(4, 12.0, -6.0, source="L"),  # roadside
        fused(5, 25.0, -3.0, source="V", hits=1),  # not confirmed
        fused(6, 26.0, -3.0, label="person"),
        fused(7, 5.0, 20.0),  # too far to the side
    ]
    assert [item.id for item in claims(believed(0, objects, None), wanted, 2.0)] == [1, 3]


def test_a_vehicle_of_which_only_the_image_is_labelled_is_not_claimed_falsely() -> None:
    """Its distance is unknown. A vehicle with a labelled position counts, whatever boxes overlap."""
    wanted = vehicles([labelled(1, *A)])
    seen, elsewhere = (0.0, 0.0, 10.0, 10.0), (50.0, 0.0, 60.0, 10.0)
    objects = [
        replace(fused(1, *A), bbox=seen),
        replace(fused(2, *B, source="V"), bbox=seen),
        replace(fused(3, 40.0), bbox=elsewhere),
    ]
    assert [item.id for item in claims(believed(0, objects, None), wanted, 2.0, [seen])] == [1, 3]


def test_without_trackeval_its_figures_are_unknown(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tracking, "_metrics", lambda: None)
    assert not tracking.is_available()
    assert count(TRUTH, TRUTH) is None
    hota = next(figure for figure in FIGURES if figure.name == "hota")
    assert hota.whole([None]) is None
