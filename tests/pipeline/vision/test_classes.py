"""Names of a network's classes come from whatever the graph's property says."""

from __future__ import annotations

import pytest

from pipeline.vision.classes import COCO_80, class_names


@pytest.mark.parametrize(
    ("said", "names"),
    [
        ("{0: 'Pedestrian', 1: 'lorry'}", ("person", "truck")),
        ("['car', 'traffic_light']", ("car", "traffic light")),
    ],
)
def test_the_graph_names_its_classes(said: str, names: tuple[str, ...]) -> None:
    assert class_names(2, {"names": said}) == names


@pytest.mark.parametrize(
    "said",
    ["", "car, bus", "{1: 'car', 2: 'bus'}", "{[]: 'car'}", "[" * 300, "-" * 100_000 + "1", "\0", "7", "{'a': 'car'}"],
)
def test_a_property_that_names_nothing_is_passed_over(said: str) -> None:
    assert class_names(80, {"names": said}) == COCO_80
    assert class_names(2, {"names": said}) == ("class 0", "class 1")
