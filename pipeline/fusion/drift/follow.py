"""Detects whether camera or LiDAR has been turned, since when, and by which angle, from vehicles that both sensors see
and from lane lines.

A vehicle's cluster should coincide with its box. If all vehicles are off by the same angle, the mounts are turned
relative to the calibration. ``compare`` finds the pairs of a frame, ``lines`` compares lane lines with own motion and
the LiDAR's road, and ``estimate`` and ``judge`` decide about the last ``fusion.drift_s`` seconds. Nothing is corrected;
the angles are reported until the alignment is changed, or until vehicles or lines show that they no longer hold.

A wrong distance law moves no box, and a bend in the road moves cluster and box alike, so neither looks like a turn. A
time offset between the sensors moves each vehicle by the rate of its bearing; it is estimated together with the angle.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from pipeline.alignment.projection import Alignment
from pipeline.fusion.drift import lines as lane_lines
from pipeline.fusion.drift.compare import Offset, offsets
from pipeline.fusion.drift.estimate import SIDE_ASPECT, AngleSightings, box_errors
from pipeline.fusion.drift.judge import FEWEST_FRAMES, PIECE_S, SMALLEST_DEG, MountTurn, TurnEstimates, judge
from pipeline.lidar.road_profile import RoadProfile
from pipeline.params import AlignmentParams, FusionParams
from pipeline.types import F64, LidarTrack, VisionMeasurement

SAME_SIZE = 0.25
"""Difference of ln(size) from which a track shows another vehicle or has another box: detectors vary by less, and a
turned camera changes no size."""
SIZES_OVER = 10
"""Number of frames over which the size of a vehicle is averaged."""
ROAD_DEG = 0.25
"""Under a vehicle whose foot is less certain than this for the road's height, the pitch is not compared: the road's
shape is the same for all vehicles and for seconds, so such errors do not average out, and ``SMALLEST_DEG`` is not much
larger. In two drives of random traffic, vehicles with 0.3° to 0.7° were off by −0.5° to −1.3° for five seconds, all
together."""
FORGOTTEN_S = 3.0
"""A vehicle unseen for so long counts as another one: it may have turned."""
HELD = 2
"""Judgements in a row, one second apart, that must find the same turn."""
CONTRADICTED_SIGMAS = 3.0
"""A reported turn is dropped once vehicles show less than half of it, this clearly."""
_PIECE_NS = round(PIECE_S * 1e9)
_PIECE, _VEHICLE, _FRAMES, _YAW, _PITCH, _RATE, _HEIGHT, _ROAD, _ASPECT, _TRACK = range(10)
_AXES = (_YAW, _PITCH)


class Drift(NamedTuple):
    """Rotation of the camera relative to its calibration."""

    yaw_deg: float
    """To the left."""
    pitch_deg: float
    """Downwards."""
    yaw_sigma_deg: float
    """Standard deviation of ``yaw_deg``."""
    pitch_sigma_deg: float
    """Standard deviation of ``pitch_deg``."""
    vehicles: int
    """Number of vehicles that it was estimated from."""
    since: str | None
    """Name of the frame since which it holds; None if it held from the beginning."""
    is_camera: bool = False
    """Whether lane lines show that the camera has turned, not the LiDAR."""

    @property
    def note(self) -> str:
        """What has happened, what follows, and the remedy."""
        since = f" since about frame {self.since}" if self.since is not None else ""
        yaw = f"yaw {self.yaw_deg:+.1f}° ± {self.yaw_sigma_deg:.1f}°"
        pitch = f"pitch {self.pitch_deg:+.1f}° ± {self.pitch_sigma_deg:.1f}°"
        sensor = "Camera" if self.is_camera else "Camera or LiDAR"
        return (
            f"{sensor} has turned{since}: {yaw}, {pitch}. Nothing is corrected; objects may appear twice, and "
            "ACC does not accelerate while they do. Check with Align, then Fit."
        )


class _Vehicle(NamedTuple):
    """A LiDAR track while it shows the same vehicle with the same box."""

    number: int
    """Never given twice."""
    track: int
    """Number of the first vehicle of the same track: what is now taken for another one may be the same."""
    t_ns: int
    """When it was last compared."""
    frames: int
    """Number of frames, at most ``SIZES_OVER``."""
    sizes: tuple[float, ...]
    """Mean ln of the sizes."""


class _Found(NamedTuple):
    """A turn about each axis, as judged last; None for an axis that has not been judged."""

    turns: tuple[MountTurn | None, MountTurn | None] = (None, None)
    """The clear turn about yaw and pitch; None without one."""
    held: tuple[int, int] = (0, 0)
    """Judgements in a row with a turn to the same side."""
    estimates: tuple[MountTurn | None, MountTurn | None] = (None, None)
    """The angle about each axis, clear or not."""


class DriftState(NamedTuple):
    """What the vehicles of the last seconds have shown."""

    alignment: AlignmentParams | None = None
    """With which they were compared."""
    vehicles: tuple[tuple[int, _Vehicle], ...] = ()
    """By id of the LiDAR track."""
    next_number: int = 0
    """Number of the next vehicle."""
    piece: int = 0
    """The piece of time under way."""
    fresh: tuple[tuple[float, ...], ...] = ()
    """Rows of the piece under way, one for each vehicle and frame."""
    rows: F64 = np.zeros((0, 10))
    """(M, 10) means over earlier pieces: piece, vehicle, frames, yaw, pitch, rate, height of the box, error of the
    road, width ÷ height of the box, track."""
    lines: lane_lines.LineState = lane_lines.LineState()
    """What lane lines have shown."""
    names: tuple[tuple[int, str], ...] = ()
    """Name of the first frame of each piece."""
    found: _Found = _Found()
    """What was judged last."""
    told: Drift | None = None
    """What is reported."""


class Seen(NamedTuple):
    """What the sensors show in one frame."""

    t_ns: int
    """The tick."""
    name: str
    """Of the frame."""
    tracks: Sequence[LidarTrack]
    """Of the LiDAR."""
    boxes: Sequence[VisionMeasurement] | None
    """Of the detector; None without an image."""
    road: RoadProfile | None
    """The road ahead; None while unknown."""
    image_size: tuple[int, int] | None
    """Width and height."""
    lines: lane_lines.RoadLines | None = None
    """Lane lines of the image; None if none were looked for."""


def follow(
    state: DriftState, seen: Seen, aligned: Alignment | None, alignment: AlignmentParams, params: FusionParams
) -> tuple[DriftState, Drift | None]:
    """The state after this frame, and the turn that is reported; None without one."""
    if aligned is None or seen.image_size is None:
        return DriftState(), None
    if state.alignment is not alignment and state.alignment != alignment:
        state = DriftState(alignment)  # the user has changed it: what was seen before says nothing about it
    piece = seen.t_ns // _PIECE_NS
    if piece != state.piece:
        state = _judged(_closed(state, piece, params), params)._replace(piece=piece)
        state = state._replace(names=(*state.names, (piece, seen.name)))
    if seen.boxes:
        held = (state.told.yaw_deg, state.told.pitch_deg) if state.told is not None else (0.0, 0.0)
        pairs = offsets(seen.tracks, seen.boxes, aligned, seen.image_size, held, seen.road)
        state = _noted(state, pairs, seen.t_ns)
    if seen.lines is not None:
        state = state._replace(lines=lane_lines.noted(state.lines, seen.lines, seen.t_ns))
    return state, state.told


def _noted(state: DriftState, pairs: Sequence[Offset], t_ns: int) -> DriftState:
    """With the offsets of one frame."""
    known, number = dict(state.vehicles), state.next_number
    rows = []
    for pair in pairs:
        sizes = np.log(np.maximum(pair.sizes_m, 0.1)).tolist()
        before = known.get(pair.track)
        is_new = before is None or t_ns - before.t_ns > FORGOTTEN_S * 1e9
        if before is None or is_new or _differ(before.sizes, sizes):
            now = _Vehicle(number, number if before is None or is_new else before.track, t_ns, 1, tuple(sizes))
            number += 1
        else:
            frames = min(before.frames + 1, SIZES_OVER)
            means = tuple(old + (new - old) / frames for old, new in zip(before.sizes, sizes, strict=True))
            now = _Vehicle(before.number, before.track, t_ns, frames, means)
        known[pair.track] = now
        aspect = pair.sizes_m[1] / pair.sizes_m[0]
        shown = (pair.yaw_deg, pair.pitch_deg, pair.rate_degps, pair.height_deg, pair.road_deg)
        rows.append((now.number, *shown, aspect, now.track))
    kept = tuple((track, each) for track, each in known.items() if t_ns - each.t_ns <= FORGOTTEN_S * 1e9)
    return state._replace(vehicles=kept, next_number=number, fresh=(*state.fresh, *rows))


def _differ(a: Sequence[float], b: Sequence[float]) -> bool:
    return max(abs(x - y) for x, y in zip(a, b, strict=True)) > SAME_SIZE


def _closed(state: DriftState, piece: int, params: FusionParams) -> DriftState:
    """With the means over the piece that has ended, and without what is too old."""
    rows = state.rows
    if state.fresh:
        fresh = np.array(state.fresh)
        numbers, at = np.unique(fresh[:, 0], return_inverse=True)
        frames = np.bincount(at)
        means = [np.bincount(at, fresh[:, k]) / frames for k in range(1, 8)]
        rows = np.vstack([rows, np.column_stack([np.full(len(numbers), state.piece), numbers, frames, *means])])
    oldest = piece - params.drift_s / PIECE_S
    names = tuple(each for each in state.names if each[0] > oldest)
    lines = lane_lines.closed(state.lines, state.piece, oldest)
    return state._replace(rows=rows[rows[:, _PIECE] > oldest], lines=lines, fresh=(), names=names)


def _judged(state: DriftState, params: FusionParams) -> DriftState:
    """With the verdict about one axis, in turn."""
    axis = state.piece % 2
    seen, values = _sightings(state, axis)
    if not len(values):
        return state
    verdict = judge(seen, values, axis)
    found = _updated(state.found, axis, verdict, params)
    return state._replace(found=found, told=_told(state, found, axis, verdict))


def _sightings(state: DriftState, axis: int) -> tuple[AngleSightings, F64]:
    """What vehicles seen often enough, and lines, have shown of an axis, and the angles, degrees."""
    rows = state.rows[(state.rows[:, _ROAD] <= ROAD_DEG) | (axis == 0)]
    numbers, at = np.unique(rows[:, _VEHICLE], return_inverse=True)
    often = np.bincount(at, rows[:, _FRAMES], len(numbers)) >= FEWEST_FRAMES
    rows, line = rows[often[at]], lane_lines.angles(state.lines, axis)
    count = len(line.values)
    own_rate, has_side = rows[:, _RATE] * (axis == 0), (rows[:, _ASPECT] > SIDE_ASPECT) & (axis == 0)
    road = rows[:, _ROAD] * (axis == 1)
    new, lasting = box_errors(rows[:, _FRAMES], rows[:, _HEIGHT], own_rate, has_side, road)
    rate = np.concatenate([own_rate, np.zeros(count)])
    piece = np.concatenate([rows[:, _PIECE], line.piece])
    order = np.argsort(piece, kind="stable")
    seen = AngleSightings(
        piece[order].astype(np.int64),
        np.unique(np.concatenate([rows[:, _VEHICLE], np.full(count, -1.0)])[order], return_inverse=True)[1],
        np.unique(np.concatenate([rows[:, _TRACK], np.full(count, -1.0)])[order], return_inverse=True)[1],
        np.concatenate([rows[:, _FRAMES], line.frames])[order],
        rate[order],
        np.concatenate([new, line.sigma_deg])[order],
        np.concatenate([lasting, np.full(count, lane_lines.LASTING_DEG[axis])])[order],
        order >= len(rows),
    )
    return seen, np.concatenate([rows[:, _AXES[axis]], line.values])[order]


def _updated(found: _Found, axis: int, verdict: TurnEstimates, params: FusionParams) -> _Found:
    turn, before = verdict.turn(params.drift_sigmas), found.turns[axis]
    goes_on = turn is not None and before is not None and turn.angle_deg * before.angle_deg > 0.0
    held = found.held[axis] + 1 if goes_on else int(turn is not None)
    other = found.turns[1 - axis]
    estimate = turn or verdict.since(other.since if other is not None else None)
    return _Found(_with(found.turns, axis, turn), _with(found.held, axis, held), _with(found.estimates, axis, estimate))


def _told(state: DriftState, found: _Found, axis: int, verdict: TurnEstimates) -> Drift | None:
    """What is reported after a verdict."""
    before = state.told
    clear = [turn for turn, held in zip(found.turns, found.held, strict=True) if turn is not None and held >= HELD]
    if clear:
        sinces = [each.since for each in clear if each.since is not None]
        since = _name(state, min(sinces)) if sinces else None
        yaw, pitch = (each or MountTurn(0.0, 0.0, 0, None) for each in found.estimates)
        since = since or (before.since if before is not None else None)
        count = max(each.vehicles for each in clear)
        # lines show yaw against the direction of travel, but pitch against the LiDAR's road
        is_camera = found.held[0] >= HELD and found.turns[0] is not None and found.turns[0].by_lines
        return Drift(yaw.angle_deg, pitch.angle_deg, yaw.sigma_deg, pitch.sigma_deg, count, since, is_camera)
    if before is None:
        return None
    told_deg = (before.yaw_deg, before.pitch_deg)[axis]
    shown = verdict.at(len(verdict.moments) - 1)
    away_deg = abs(shown.angle_deg - told_deg)
    is_gone = away_deg > max(abs(told_deg) / 2, CONTRADICTED_SIGMAS * shown.sigma_deg)
    return None if is_gone and abs(told_deg) > SMALLEST_DEG else before


def _name(state: DriftState, piece: int) -> str | None:
    """Of the first frame from a piece of time on."""
    return next((name for number, name in state.names if number >= piece), None)


def _with(pair, axis: int, value):  # type: ignore[no-untyped-def]
    return (value, pair[1]) if axis == 0 else (pair[0], value)
