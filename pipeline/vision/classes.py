"""Class names of detectors in COCO's spelling, by which the pipeline distinguishes vehicles from other objects."""

from __future__ import annotations

import ast
from collections.abc import Mapping

COCO_80 = (
    "person", "bicycle", "car", "motorcycle", "airplane", "bus", "train", "truck", "boat", "traffic light",
    "fire hydrant", "stop sign", "parking meter", "bench", "bird", "cat", "dog", "horse", "sheep", "cow", "elephant",
    "bear", "zebra", "giraffe", "backpack", "umbrella", "handbag", "tie", "suitcase", "frisbee", "skis", "snowboard",
    "sports ball", "kite", "baseball bat", "baseball glove", "skateboard", "surfboard", "tennis racket", "bottle",
    "wine glass", "cup", "fork", "knife", "spoon", "bowl", "banana", "apple", "sandwich", "orange", "broccoli",
    "carrot", "hot dog", "pizza", "donut", "cake", "chair", "couch", "potted plant", "bed", "dining table", "toilet",
    "tv", "laptop", "mouse", "remote", "keyboard", "cell phone", "microwave", "oven", "toaster", "sink",
    "refrigerator", "book", "clock", "vase", "scissors", "teddy bear", "hair drier", "toothbrush",
)  # fmt: skip
"""The 80 classes of COCO 2017, in the order used by every COCO-trained YOLO."""

_ON_ROADS = ("person", "bicycle", "car", "motorcycle", "bus", "train", "truck")
_ANIMALS = ("bird", "cat", "dog", "horse", "sheep", "cow", "elephant", "bear", "zebra", "giraffe")
NOT_ON_ROADS = frozenset(COCO_80) - {*_ON_ROADS, *_ANIMALS}
"""COCO's classes that no road user belongs to. A network trained on COCO sees a suitcase in the rear of a car; a LiDAR
cluster that carried this name would not count as an obstacle."""
SEEN_AS = {"train": "bus"}
"""What a class of COCO is on a road: a tram, or a bus or lorry that the network takes for a train."""

SYNONYMS = {
    "motorbike": "motorcycle",
    "van": "car",
    "vehicle": "car",
    "pedestrian": "person",
    "cyclist": "bicycle",
    "lorry": "truck",
}
"""Names in other data sets for the classes that matter on a road."""


def canonical(name: str) -> str:
    """A class name in COCO's spelling: lower case, known synonyms replaced."""
    lowered = name.strip().lower().replace("_", " ")
    return SYNONYMS.get(lowered, lowered)


def class_names(count: int, metadata: Mapping[str, str]) -> tuple[str, ...]:
    """Names of a network's ``count`` classes (0: not known from its shape): from the property ``names`` of the graph
    (v5/v8 exports store a Python mapping of number to name there), else COCO's, else "class 0", "class 1", …"""
    named = _from_metadata(metadata.get("names", ""))
    if named and count in (0, len(named)):
        return named
    return COCO_80 if count in (0, len(COCO_80)) else tuple(f"class {index}" for index in range(count))


def _from_metadata(text: str) -> tuple[str, ...]:
    try:
        value = ast.literal_eval(text)
    except (ValueError, TypeError, SyntaxError, MemoryError, RecursionError):  # all errors that literal_eval may raise
        return ()
    if isinstance(value, dict) and set(value) == set(range(len(value))):
        value = [value[index] for index in range(len(value))]
    return tuple(canonical(str(name)) for name in value) if isinstance(value, list | tuple) else ()
