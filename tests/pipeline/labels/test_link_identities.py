"""Linking objects over time where labels have no identities."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pipeline.common.geometry import Cuboid
from pipeline.labels.link_identities import linked
from pipeline.sources import open_source
from pipeline.types.source import TruthObject

PERIOD_NS = 100_000_000


def at(x: float, y: float = 0.0, label: str = "Car", yaw_rad: float = 0.0) -> TruthObject:
    return TruthObject(label, Cuboid((x, y, 0.7), (4.0, 1.8, 1.5), yaw_rad))


def ids(*frames: tuple[TruthObject, ...], period_ns: int = PERIOD_NS) -> list[list[int | None]]:
    found = linked({index * period_ns: frame for index, frame in enumerate(frames)})
    return [[item.id for item in found[tick]] for tick in sorted(found)]


@pytest.mark.parametrize(
    ("frames", "wanted"),
    [
        (((at(20.0),), (at(20.5),), (at(21.0),)), [[1], [1], [1]]),
        (((at(60.0),), (at(56.0),), (at(52.0),)), [[1], [1], [1]]),
        (((at(20.0),), (at(20.0, 4.0),)), [[1], [2]]),
        (((at(20.0),), (at(20.0, label="Truck"),)), [[1], [2]]),
        (((at(20.0), at(26.0)), (at(23.9), at(17.9))), [[1, 2], [2, 1]]),
        (((at(60.0), at(66.0)), (at(56.0), at(62.0)), (at(52.0), at(58.0))), [[1, 2], [1, 2], [1, 2]]),
        (((at(20.0),), (), (at(20.0),)), [[1], [], [2]]),
    ],
    ids=["slow", "oncoming", "another lane", "another class", "order", "a column comes", "it was away"],
)
def test_each_is_the_one_that_was_nearest_to_where_it_should_be(
    frames: tuple[tuple[TruthObject, ...], ...], wanted: list[list[int]]
) -> None:
    assert ids(*frames) == wanted


def test_nobody_is_who_they_were_after_a_gap() -> None:
    assert ids((at(20.0),), (at(20.0),), period_ns=2_000_000_000) == [[1], [2]]


def test_in_the_simulators_traffic_nobody_is_taken_for_another() -> None:
    """Including a column of oncoming traffic. The simulator's ids are removed and linked again."""
    source = open_source("sim:straight")
    truth = {source.t_ns(index): source.truth(index) or () for index in range(80)}
    found = linked({tick: tuple(replace(item, id=None) for item in items) for tick, items in truth.items()})
    pairs = {(a.id, b.id) for tick in truth for a, b in zip(truth[tick], found[tick], strict=True)}
    assert len({number for _, number in pairs}) == len(pairs), "one number stands for two"
    assert len(pairs) <= len({number for number, _ in pairs}) + 1
