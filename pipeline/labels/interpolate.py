"""Interpolates a track between its keyframes and extends it beyond them, after a person has set one.

Between keyframes a vehicle is rigid and moves smoothly: its size is that of the keyframe nearest in time, its yaw turns
the short way, and its centre follows a monotone cubic (Fritsch and Carlson, *Monotone Piecewise Cubic Interpolation*,
1980) through the keyframes in time, which never overshoots. Beyond the outermost keyframes its motion is unknown:
existing positions are kept, and shifted as the keyframe was.

An image box is corrected separately: a detector's boxes are right in most frames, and turning a cuboid does not change
them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.interpolate import PchipInterpolator

from pipeline.common.errors import BadInput
from pipeline.common.geometry import Cuboid
from pipeline.labels.model import Sighting
from pipeline.types import Box

Track = Mapping[int, Sighting]
"""Sightings by frame."""


def put_keyframe(
    track: Track, sighting: Sighting, t_ns: Sequence[int], *, interpolate: bool = True
) -> dict[int, Sighting]:
    """The track with a keyframe set by a person. t_ns: of every frame of the recording.

    Frames without a sighting stay without, except those between a new frame and the nearest existing sightings.
    interpolate: neighbouring frames follow; otherwise only this frame changes. BadInput if frames would follow across a
    step back in time.
    """
    frame = sighting.frame
    put = {**track, frame: replace(sighting, keyframe=True)}
    if not interpolate:
        return _ordered(put)
    old = track.get(frame)
    if old is None:
        return _ordered(_joined(put, frame, t_ns))
    shifted = _shifted_beyond(put, old, frame)
    return _ordered(_between(_boxes_after(shifted, old, frame, t_ns), t_ns))


def drop_keyframe(track: Track, frame: int, t_ns: Sequence[int]) -> dict[int, Sighting]:
    """The track with one keyframe removed: the frame then follows the others, or stays unchanged if there is none
    beyond it. BadInput if time steps back between these."""
    return _ordered(_between({**track, frame: replace(track[frame], keyframe=False)}, t_ns))


def resized(cuboid: Cuboid, size: tuple[float, float, float]) -> Cuboid:
    """The cuboid with another size; its point nearest to the ego origin, seen from above, and its bottom stay in place,
    because the sensors saw the near side."""
    (x, y, z), (length, width, height), yaw_rad = cuboid
    c, s = math.cos(yaw_rad), math.sin(yaw_rad)
    # relative position of that point: −1 on the rear or right side, 1 opposite
    along = _clipped(-(x * c + y * s) / (length / 2))
    across = _clipped((x * s - y * c) / (width / 2))
    dl, dw = along * (length - size[0]) / 2, across * (width - size[1]) / 2
    return Cuboid((x + dl * c - dw * s, y + dl * s + dw * c, z + (size[2] - height) / 2), size, yaw_rad)


def _between(track: dict[int, Sighting], t_ns: Sequence[int]) -> dict[int, Sighting]:
    """Recomputes every cuboid between two keyframes. A keyframe that is only in the image ends the interpolation."""
    for run in _runs(track):
        inside = [f for f in track if run[0] < f < run[-1] and not track[f].keyframe]
        if inside:
            cuboids = _follow([(t_ns[f], track[f].cuboid) for f in run], [t_ns[f] for f in inside])  # type: ignore[misc]
            track |= {f: replace(track[f], cuboid=each) for f, each in zip(inside, cuboids, strict=True)}
    return track


def _runs(track: Track) -> list[list[int]]:
    """Keyframes with a cuboid, in order, split at keyframes without one."""
    runs: list[list[int]] = [[]]
    for frame in sorted(f for f, each in track.items() if each.keyframe):
        if track[frame].cuboid is None:
            runs.append([])
        else:
            runs[-1].append(frame)
    return [run for run in runs if len(run) > 1]


def _follow(keys: Sequence[tuple[int, Cuboid]], at_ns: Sequence[int]) -> list[Cuboid]:
    """Cuboids interpolated between given ones, at times within their range."""
    _require_forward([t for t, _ in keys])
    start = keys[0][0]
    times = np.array([t - start for t, _ in keys]) / 1e9
    wanted = np.array([t - start for t in at_ns]) / 1e9
    places = np.array([cuboid.center for _, cuboid in keys])
    yaws = np.unwrap([cuboid.yaw_rad for _, cuboid in keys])
    centers = PchipInterpolator(times, places)(wanted)
    turned = np.interp(wanted, times, yaws)
    nearest = np.abs(wanted[:, None] - times[None]).argmin(axis=1)
    return [
        Cuboid((float(x), float(y), float(z)), keys[int(k)][1].size, _wrapped(float(yaw)))
        for (x, y, z), yaw, k in zip(centers, turned, nearest, strict=True)
    ]


def _joined(track: dict[int, Sighting], frame: int, t_ns: Sequence[int]) -> dict[int, Sighting]:
    """Adds the frames between a new sighting and the track's nearest ones on either side."""
    before = max((f for f in track if f < frame), default=None)
    after = min((f for f in track if f > frame), default=None)
    for first, last in ((before, frame), (frame, after)):
        if first is None or last is None:
            continue
        inside = list(range(first + 1, last))
        a, b = track[first], track[last]
        cuboids: list[Cuboid | None] = [None] * len(inside)
        if a.cuboid is not None and b.cuboid is not None and inside:
            cuboids = list(_follow([(t_ns[first], a.cuboid), (t_ns[last], b.cuboid)], [t_ns[f] for f in inside]))
        for f, cuboid in zip(inside, cuboids, strict=True):
            share = _share(t_ns, first, f, last)
            bbox = _mixed(a.bbox, b.bbox, share) if a.bbox is not None and b.bbox is not None else None
            if cuboid is not None or bbox is not None:
                track[f] = Sighting(f, cuboid, bbox, keyframe=False)
    return track


def _shifted_beyond(track: dict[int, Sighting], old: Sighting, frame: int) -> dict[int, Sighting]:
    """If ``frame`` is the outermost keyframe on a side, the frames beyond it are moved, rotated and resized in the same
    way."""
    new = track[frame].cuboid
    if old.cuboid is None or new is None or old.cuboid == new:
        return track
    fitted = resized(old.cuboid, new.size) if new.size != old.cuboid.size else old.cuboid
    moved = tuple(a - b for a, b in zip(new.center, fitted.center, strict=True))
    turn_rad = _wrapped(new.yaw_rad - old.cuboid.yaw_rad)
    keys = [f for f, each in track.items() if each.keyframe]
    for f, each in track.items():
        beyond = (f < frame and frame == min(keys)) or (f > frame and frame == max(keys))
        if not beyond or each.cuboid is None:
            continue
        base = resized(each.cuboid, new.size) if new.size != old.cuboid.size else each.cuboid
        x, y, z = (a + d for a, d in zip(base.center, moved, strict=True))
        track[f] = replace(each, cuboid=Cuboid((x, y, z), base.size, _wrapped(base.yaw_rad + turn_rad)))
    return track


def _boxes_after(track: dict[int, Sighting], old: Sighting, frame: int, t_ns: Sequence[int]) -> dict[int, Sighting]:
    """Image boxes corrected in the same way as the one in ``frame``: decreasing towards the next keyframe, or
    completely if there is none."""
    new = track[frame].bbox
    if old.bbox is None or new is None or old.bbox == new:
        return track
    keys = [f for f, each in track.items() if each.keyframe and f != frame]
    before, after = max((f for f in keys if f < frame), default=None), min((f for f in keys if f > frame), default=None)
    for f, each in track.items():
        outside = (before is not None and f <= before) or (after is not None and f >= after)
        if f == frame or outside or each.bbox is None:
            continue
        end = before if f < frame else after
        share = 1.0 if end is None else _share(t_ns, end, f, frame)
        bbox = tuple(v + share * (n - o) for v, n, o in zip(each.bbox, new, old.bbox, strict=True))
        if bbox[0] < bbox[2] and bbox[1] < bbox[3]:
            track[f] = replace(each, bbox=bbox)  # type: ignore[arg-type]
    return track


def _share(t_ns: Sequence[int], first: int, frame: int, last: int) -> float:
    """Relative position of ``frame`` in time, from ``first`` (0) to ``last`` (1)."""
    _require_forward([t_ns[f] for f in sorted((first, last))])
    return (t_ns[frame] - t_ns[first]) / (t_ns[last] - t_ns[first])


def _require_forward(times_ns: Sequence[int]) -> None:
    if any(after <= before for before, after in pairwise(times_ns)):
        raise BadInput(
            "the recording's clock steps back between these keyframes: positions between them cannot be interpolated"
        )


def _mixed(a: Box, b: Box, share: float) -> Box:
    return tuple((1.0 - share) * u + share * v for u, v in zip(a, b, strict=True))  # type: ignore[return-value]


def _clipped(value: float) -> float:
    return min(max(value, -1.0), 1.0)


def _wrapped(angle_rad: float) -> float:
    """In (−π, π]; a value in this range is returned unchanged."""
    if -math.pi < angle_rad <= math.pi:
        return angle_rad
    return math.pi - (math.pi - angle_rad) % (2.0 * math.pi)


def _ordered(track: Track) -> dict[int, Sighting]:
    return {frame: track[frame] for frame in sorted(track)}
