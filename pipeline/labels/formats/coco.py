"""Boxes in images as COCO has them (Lin et al. 2014; cocodataset.org, "Data format"), with the ``videos`` and
``tracks`` that TAO adds for objects over time (Dave et al. 2020).

``bbox`` is left, top, width, height in pixels of the raw image. ``id`` of an image is 1 + the frame. Regions without
labels are ``iscrowd``, which scores and most training code ignore.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

from pydantic import BaseModel, Field, TypeAdapter

from pipeline.common.errors import BadInput
from pipeline.formats.kitti_records import UNLABELLED
from pipeline.labels.formats.base import Imported, LabeledDrive, write_file
from pipeline.labels.formats.reading import parse_as, read_bytes
from pipeline.labels.model import LabelSet, LabelTrack, Origin, Sighting
from pipeline.types import Box
from pipeline.vision.classes import canonical

_VIDEO = 1


class _Image(BaseModel):
    id: int
    file_name: str = ""
    frame_index: int | None = None


class _Annotation(BaseModel):
    id: int = 0
    image_id: int
    category_id: int
    bbox: tuple[float, float, float, float]
    track_id: int | None = None


class _Category(BaseModel):
    id: int
    name: str


class _Coco(BaseModel):
    images: list[_Image]
    annotations: list[_Annotation] = Field(default_factory=list)
    categories: list[_Category] = Field(default_factory=list)


_FILE = TypeAdapter(_Coco)


def write(labels: LabelSet, drive: LabeledDrive, out: Path) -> tuple[str, ...]:
    """BadInput if the recording has no images, whose size the format requires."""
    categories = {name: place for place, name in enumerate(sorted({track.label for track in labels.tracks}), start=1)}
    size = next((shot.size for shot in drive.shots if shot.size is not None), None)
    if size is None:
        raise BadInput("COCO labels images; this recording has none")
    names = drive.file_names()
    content = {
        "info": {"description": drive.uri, "version": "1.0"},
        "videos": [{"id": _VIDEO, "name": drive.uri, "width": size[0], "height": size[1]}],
        "images": [
            {
                "id": index + 1,
                "file_name": f"{names[index]}.jpg",
                "width": (shot.size or size)[0],
                "height": (shot.size or size)[1],
                "video_id": _VIDEO,
                "video": drive.uri,
                "frame_index": index,
            }
            for index, shot in enumerate(drive.shots)
        ],
        "categories": [{"id": number, "name": name, "supercategory": ""} for name, number in categories.items()],
        "tracks": [
            {"id": track.id, "category_id": categories[track.label], "video_id": _VIDEO} for track in labels.tracks
        ],
        "annotations": _annotations(labels, categories),
    }
    write_file(out, json.dumps(content, separators=(",", ":"), ensure_ascii=False, allow_nan=False).encode())
    return tuple(
        f"class {name!r} will be read as {canonical(name)!r}" for name in categories if canonical(name) != name
    )


def read(path: Path, drive: LabeledDrive, origin: Origin) -> Imported:
    """Boxes without ``track_id`` become separate tracks."""
    coco = parse_as(_FILE, read_bytes(path), str(path))
    frames = _frames(coco.images, drive, str(path))
    categories = {each.id: drive.class_of(each.name, "coco") for each in coco.categories}
    found: dict[int, tuple[str, dict[int, Sighting]]] = {}
    alone: list[tuple[str, Sighting]] = []
    for each in coco.annotations:
        what = f"{path}, annotation {each.id}"
        if each.image_id not in frames or each.category_id not in categories:
            raise BadInput(f"{what}: an image or category that does not exist")
        x, y, width, height = each.bbox
        label, sighting = (
            categories[each.category_id],
            Sighting(frames[each.image_id], None, (x, y, x + width, y + height)),
        )
        if each.track_id is None:
            alone.append((label, sighting))
            continue
        of_track, sightings = found.setdefault(each.track_id, (label, {}))
        if sighting.frame in sightings or label != of_track:
            raise BadInput(f"{what}: track {each.track_id} occurs twice, or with two classes")
        sightings[sighting.frame] = sighting
    tracks = [
        LabelTrack(number, label, tuple(sightings[frame] for frame in sorted(sightings)), "accepted", origin)
        for number, (label, sightings) in sorted(found.items())
    ]
    first = max(found, default=0) + 1
    tracks += [LabelTrack(first + i, label, (one,), "accepted", origin) for i, (label, one) in enumerate(alone)]
    note = (f"{len(alone):,} boxes without identity: each becomes its own track",) if alone else ()
    return Imported(replace(drive.empty(), tracks=tuple(tracks)), note)


def _annotations(labels: LabelSet, categories: dict[str, int]) -> list[dict[str, object]]:
    boxes: list[tuple[int, int, str, Box]] = sorted(
        (sighting.frame, track.id, track.label, sighting.bbox)
        for track in labels.tracks
        for sighting in track.sightings
        if sighting.bbox is not None
    )
    return [
        {
            "id": number,
            "image_id": frame + 1,
            "category_id": categories[label],
            "bbox": [x1, y1, x2 - x1, y2 - y1],
            "area": (x2 - x1) * (y2 - y1),
            "iscrowd": int(label == UNLABELLED),
            "segmentation": [],
            "track_id": track,
            "video_id": _VIDEO,
        }
        for number, (frame, track, label, (x1, y1, x2, y2)) in enumerate(boxes, start=1)
    ]


def _frames(images: list[_Image], drive: LabeledDrive, what: str) -> dict[int, int]:
    """Image id → frame: by ``frame_index`` if given, else by the file's name without its suffix."""
    by_name = {name: index for index, name in enumerate(drive.file_names())}
    frames: dict[int, int] = {}
    for image in images:
        index = image.frame_index
        if index is None:
            index = by_name.get(Path(image.file_name).stem)
        if index is None or not 0 <= index < len(drive.shots):
            raise BadInput(f"{what}: image {image.id} ({image.file_name[:60]}) is not a frame of {drive.uri}")
        frames[image.id] = index
    return frames
