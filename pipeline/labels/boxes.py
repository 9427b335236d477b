"""Image boxes that follow their cuboids: drawn around the projection and clipped to the image, unless set by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.alignment.projection import Pinhole, project_cuboids
from pipeline.common.geometry import Cuboid, corners_of
from pipeline.labels.formats.base import LabeledDrive
from pipeline.labels.model import LabelSet, Sighting
from pipeline.types import Box, CameraCalibration


def following(labels: LabelSet, drive: LabeledDrive) -> LabelSet:
    """The labels with each cuboid's box in its frame's image, and the share of it that is cut off. Boxes that were set
    and truncations that were imported stay unchanged, as does everything in frames without a calibrated camera. Objects
    outside the image get no box."""
    by_frame: dict[int, list[tuple[int, Sighting]]] = {}
    for track in labels.tracks:
        for each in track.sightings:
            if each.cuboid is not None and drive.shots[each.frame].camera is not None:
                by_frame.setdefault(each.frame, []).append((track.id, each))
    found: dict[tuple[int, int], Sighting] = {}
    for frame, seen in by_frame.items():
        camera = drive.shots[frame].camera
        assert camera is not None
        shapes = boxes_of([each.cuboid for _, each in seen if each.cuboid is not None], camera)
        for (track_id, each), (box, cut) in zip(seen, shapes, strict=True):
            found[track_id, frame] = replace(
                each,
                bbox=each.bbox if each.box_set and each.bbox is not None else box,
                truncation=cut if each.truncation is None else each.truncation,
            )
    tracks = (
        replace(track, sightings=tuple(found.get((track.id, each.frame), each) for each in track.sightings))
        for track in labels.tracks
    )
    return replace(labels, tracks=tuple(tracks))


def boxes_of(cuboids: list[Cuboid], camera: CameraCalibration) -> list[tuple[Box | None, float | None]]:
    """For each cuboid, the box around it in the raw image, and the share 0–1 of that box that the image cuts off. None
    for both if it is outside."""
    view = Pinhole(camera.K, camera.distortion, camera.T_camera_ego)
    corners = corners_of(cuboids)
    clipped = project_cuboids(view, corners, camera.width, camera.height)
    pixels = view.project(corners.reshape(-1, 3)).reshape(-1, 8, 2)
    found: list[tuple[Box | None, float | None]] = []
    for box, uv in zip(clipped, pixels, strict=True):
        if box is None:
            found.append((None, None))
            continue
        width, height = np.nanmax(uv, axis=0) - np.nanmin(uv, axis=0)
        kept = (box[2] - box[0]) * (box[3] - box[1]) / max(float(width * height), 1e-9)
        found.append((box, round(min(max(1.0 - kept, 0.0), 1.0), 4)))
    return found
