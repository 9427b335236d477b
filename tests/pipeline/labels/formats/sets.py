"""Label sets of every kind, a drive that they are of, and when two are the same up to rounding."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from typing import TypeVar

import numpy as np
import pytest
from hypothesis import strategies as st

from pipeline.common.geometry import Cuboid, inverse, rotation
from pipeline.labels.formats.base import FrameInfo, LabeledDrive
from pipeline.labels.model import (
    Attribute,
    EventLabel,
    FrameTag,
    LabelSet,
    LabelTrack,
    LeadRange,
    Origin,
    PathLabel,
    Sighting,
)
from pipeline.types import CameraCalibration, EgoState

COUNT = 6
CLASSES = ("car", "truck", "bus", "motorcycle", "bicycle", "person", "trailer")
T = TypeVar("T")
IMPORT = Origin("import", "file", 1_700_000_000_000)
CAMERA_AXES = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


def camera(distortion: tuple[float, ...] = (), pitch_rad: float = 0.03) -> CameraCalibration:
    """A camera 1.2 m above the ego origin that faces ahead, slightly down and to the left."""
    T_ego_camera = np.eye(4)
    T_ego_camera[:3, :3] = rotation(0.01, pitch_rad, 0.02) @ CAMERA_AXES
    T_ego_camera[:3, 3] = (-1.0, 0.1, 1.2)
    K = np.array([[800.0, 0.0, 640.0], [0.0, 810.0, 360.0], [0.0, 0.0, 1.0]])
    return CameraCalibration(K, np.array(distortion), inverse(T_ego_camera), 1280, 720)


def drive(of: CameraCalibration | None = None, yaw_rate_radps: float | None = 0.1) -> LabeledDrive:
    eye = of if of is not None else camera()
    shots = tuple(
        FrameInfo(f"{i:06d}", 10**9 + i * 10**8, eye, (1280, 720), eye.T_camera_ego, EgoState(0, 12.0, yaw_rate_radps))
        for i in range(COUNT)
    )
    return LabeledDrive("sim:somewhere", shots)


NUMBERS = st.floats(-80.0, 80.0, allow_subnormal=False)
SIZES = st.floats(0.2, 20.0)
CUBOIDS = st.builds(
    Cuboid,
    st.tuples(st.floats(2.0, 120.0), NUMBERS, st.floats(-3.0, 5.0)),
    st.tuples(SIZES, SIZES, SIZES),
    st.floats(-math.pi, math.pi),
)
BOXES = st.tuples(st.floats(0, 600), st.floats(0, 300), st.floats(2, 600), st.floats(2, 300)).map(
    lambda b: (b[0], b[1], b[0] + b[2], b[1] + b[3])
)
TEXTS = st.text(st.characters(exclude_categories=("Cs", "Cc")), max_size=12)
STATES = st.sampled_from(["proposed", "accepted", "corrected", "rejected"])
ORIGINS = st.builds(
    Origin,
    st.sampled_from(["pipeline", "person", "import"]),
    TEXTS,
    st.integers(0, 2**45),
    st.none() | st.text("abcdef0123456789", min_size=1, max_size=8),
    st.none() | st.text("abcdef0123456789", min_size=1, max_size=8),
    TEXTS,
)
FRAMES = st.integers(0, COUNT - 1)
RANGES = st.tuples(FRAMES, FRAMES).map(sorted)
LINES = st.lists(st.tuples(NUMBERS, NUMBERS), min_size=1, max_size=4).map(tuple)


def several(each: st.SearchStrategy[T]) -> st.SearchStrategy[tuple[T, ...]]:
    return st.lists(each, max_size=2).map(tuple)


@st.composite
def label_sets(draw: st.DrawFn) -> LabelSet:
    """Label sets with everything that they can contain."""
    ids = draw(st.lists(st.integers(0, 2**62), unique=True, max_size=4))
    tracks = []
    for number in ids:
        frames = sorted(draw(st.sets(FRAMES)))
        seen = tuple(
            Sighting(
                i, draw(st.none() | CUBOIDS), box := draw(st.none() | BOXES), draw(st.booleans()), box is not None, *cut
            )
            for i in frames
            for cut in (draw(st.sampled_from([(None, None), (0.25, 2), (0.0, 0)])),)
        )
        tracks.append(
            LabelTrack(
                number,
                draw(st.sampled_from(CLASSES)),
                seen,
                draw(STATES),
                draw(ORIGINS),
                draw(TEXTS),
                draw(TEXTS),
                attributes=draw(several(st.builds(lambda ends, *said: Attribute(*ends, *said), RANGES, TEXTS, TEXTS))),
            )
        )
    here = drive()
    return LabelSet(
        here.uri,
        here.frames,
        here.t_ns,
        tuple(tracks),
        draw(leads(ids)),
        draw(
            several(st.builds(PathLabel, FRAMES, st.none() | LINES, st.none() | LINES, STATES, ORIGINS, TEXTS, TEXTS))
        ),
        draw(
            several(
                st.builds(
                    EventLabel, FRAMES, TEXTS, several(st.sampled_from(ids or [7])), STATES, ORIGINS, TEXTS, TEXTS
                )
            )
        ),
        draw(several(st.builds(lambda ends, *said: FrameTag(*ends, *said), RANGES, TEXTS, ORIGINS))),
        draw(TEXTS),
    )


@st.composite
def leads(draw: st.DrawFn, ids: list[int]) -> tuple[LeadRange, ...]:
    """Ranges that do not overlap, in order of frames."""
    cuts = sorted(draw(st.sets(st.integers(0, COUNT), max_size=4)))
    found = []
    for first, end in pairwise(cuts):
        if draw(st.booleans()):
            who = draw(st.sampled_from([*ids, "none", "unknown"]))
            found.append(LeadRange(first, end - 1, who, draw(STATES), draw(ORIGINS), draw(TEXTS), draw(TEXTS)))
    return tuple(found)


def plain(labels: LabelSet, *, cuboids: bool = True, boxes: bool = True) -> LabelSet:
    """Only the tracks, as returned by a format without states and origins."""
    tracks = []
    for track in labels.tracks:
        seen = (
            replace(s, cuboid=s.cuboid if cuboids else None, bbox=s.bbox if boxes else None, keyframe=True)
            for s in track.sightings
        )
        kept = tuple(s for s in seen if s.cuboid is not None or s.bbox is not None)
        if kept and track.state != "rejected":
            tracks.append(LabelTrack(track.id, track.label, kept, "accepted", IMPORT))
    tracks.sort(key=lambda track: track.id)
    return LabelSet(labels.source, labels.frames, labels.t_ns, tuple(tracks))


def assert_same_alone(found: LabelSet, wanted: LabelSet, tolerance: float = 1e-6) -> None:
    """Like ``assert_same``, but without identities over time: each sighting is its own track."""
    left = _alone(found)
    for label, seen in _alone(wanted):
        near = (n for n, (other, each) in enumerate(left) if other == label and _are_near(each, seen, tolerance))
        del left[next(near)]
    assert left == []


def _alone(labels: LabelSet) -> list[tuple[str, Sighting]]:
    return [(track.label, sighting) for track in labels.tracks for sighting in track.sightings]


def _are_near(one: Sighting, other: Sighting, tolerance: float) -> bool:
    numbers = []
    for each in (one, other):
        shape = (*each.cuboid.center, *each.cuboid.size) if each.cuboid is not None else ()
        turn = each.cuboid.yaw_rad if each.cuboid is not None else 0.0
        numbers.append((each.frame, *shape, *(each.bbox or ()), math.cos(turn), math.sin(turn)))
    return len(numbers[0]) == len(numbers[1]) and numbers[0] == pytest.approx(numbers[1], abs=max(tolerance, 1e-5))


def assert_same(found: LabelSet, wanted: LabelSet, tolerance: float = 1e-6) -> None:
    """Check that both are equal, with a tolerance for shapes and modulo full turns for angles."""
    assert replace(found, tracks=(), paths=()) == replace(wanted, tracks=(), paths=())
    assert [replace(t, sightings=()) for t in found.tracks] == [replace(t, sightings=()) for t in wanted.tracks]
    assert found.paths == wanted.paths
    for one, other in zip(found.tracks, wanted.tracks, strict=True):
        assert [(s.frame, s.keyframe) for s in one.sightings] == [(s.frame, s.keyframe) for s in other.sightings]
        for s, w in zip(one.sightings, other.sightings, strict=True):
            assert (s.cuboid is None, s.bbox is None) == (w.cuboid is None, w.bbox is None)
            if s.bbox is not None and w.bbox is not None:
                assert s.bbox == pytest.approx(w.bbox, abs=max(tolerance, 1e-5))
            if s.cuboid is not None and w.cuboid is not None:
                assert s.cuboid.center == pytest.approx(w.cuboid.center, abs=tolerance)
                assert s.cuboid.size == pytest.approx(w.cuboid.size, abs=tolerance)
                assert math.remainder(s.cuboid.yaw_rad - w.cuboid.yaw_rad, math.tau) == pytest.approx(
                    0.0, abs=tolerance
                )
