"""Acts whose numbers are measured in sensor data instead of given by a person."""

from __future__ import annotations

from pydantic import ValidationError

from app.core.request_shapes import CuboidShape
from app.drive.open_recording import OpenRecording
from app.labels.acts.around import around, poses_around, sweeps_of
from app.labels.acts.found import AddMeasured, AddSightings
from app.labels.acts.request_fields import Placed
from app.labels.acts.requests import Lift, Propagate, Refit, SetSighting
from app.labels.acts.scope import Scope
from app.labels.errors import ActRefused, BadAct
from app.labels.store.drive_labels import DriveLabels
from app.labels.wording import frames_text
from pipeline.common.geometry import Cuboid
from pipeline.labels.cuboid_from_pixel import lift
from pipeline.labels.cuboids.propagate import MOST_FRAMES, propagated
from pipeline.labels.cuboids.snap import refit
from pipeline.labels.model import LabelTrack, Sighting
from pipeline.params import Params
from pipeline.types import Frame
from pipeline.types.rounding import DECIMALS
from pipeline.vision.classes import canonical


def measured(
    labels: DriveLabels, recording: OpenRecording, params: Params, act: Refit | Lift | Propagate
) -> tuple[SetSighting | AddMeasured | AddSightings, str]:
    """Measures in the sensors' data what a person requested; returns the resulting act and how it was measured.
    BadInput if there is nothing to measure."""
    if isinstance(act, Propagate):
        return carried_on(labels, recording, act), ""
    Scope(labels.info.t_ns).check(act.frame)
    frame = recording.input(act.frame)
    if isinstance(act, Refit):
        return refitted(labels, frame, params, act, recording)
    return lifted(frame, params, act)


def refitted(
    labels: DriveLabels, frame: Frame, params: Params, act: Refit, recording: OpenRecording | None = None
) -> tuple[SetSighting, str]:
    """The track's cuboid in a frame, fitted to the points in and near it, of this sweep and, with a recording, of the
    surrounding ones; if it is only visible in the image, to the points inside its box. ActRefused if the track is not
    in the frame, if nothing fits better than the existing cuboid, or if the distance would come from the image alone;
    BadInput with too few points."""
    track = labels.track(act.track).value
    assert isinstance(track, LabelTrack)
    sighting = track.at(act.frame)
    if sighting is None:
        raise ActRefused(f"#{act.track} is not in {frames_text(act.frame)}")
    if frame.sweep is None:
        raise ActRefused(f"{frames_text(act.frame)} has no points")
    if sighting.cuboid is not None:
        sweeps = sweeps_of(recording) if recording is not None else None
        seen_around = around(recording, track, sighting, sweeps) if recording is not None and sweeps else None
        found = refit(frame.sweep.points, sighting.cuboid, seen_around)
        if not found.is_better:
            raise ActRefused(f"left #{act.track} as is: no position fits the {found.points} points better")
        cuboid = found.cuboid
        of = f" and those of {found.sweeps} sweeps" if found.sweeps > 1 else ""
        note = f"fitted to {found.points} points{of}" + ("" if found.turned else "; its heading stays")
    else:
        seen = lift(frame, params, track.label, sighting.bbox)
        if not seen.points:
            raise ActRefused(f"#{act.track}: {seen.how}; too rough for a label: draw it by hand")
        cuboid, note = seen.cuboid, f"{seen.how}; check its front (Shift X reverses it)"
    placed = SetSighting(
        kind="set_sighting",
        track=act.track,
        revision=act.revision,
        frame=act.frame,
        cuboid=_given(cuboid),
        bbox=sighting.bbox,
        box_set=sighting.box_set,
    )
    return placed, note


def carried_on(labels: DriveLabels, recording: OpenRecording, act: Propagate) -> AddSightings:
    """The frames beyond a track's ends in which it is found. ActRefused if there are none."""
    track = labels.track(act.track).value
    assert isinstance(track, LabelTrack)
    placed = [each.frame for each in track.sightings if each.cuboid is not None]
    if not placed:
        raise ActRefused(f"#{act.track} has no cuboid to extend: fit (S) or draw one first")
    sweeps = sweeps_of(recording)
    found: list[Sighting] = []
    for way, end, forward in (("forward", placed[-1], True), ("backward", placed[0], False)):
        if act.way in ("both", way):
            poses = poses_around(recording, end, MOST_FRAMES)
            found += propagated(track.sightings, labels.info.t_ns, sweeps, poses, forward=forward)
    if not found:
        raise ActRefused(f"#{act.track} was not found before its first or after its last frame")
    shapes = tuple(Placed(frame=each.frame, cuboid=_given(each.cuboid)) for each in found if each.cuboid is not None)
    return AddSightings(kind="propagate", track=act.track, revision=act.revision, sightings=shapes)


def lifted(frame: Frame, params: Params, act: Lift) -> tuple[AddMeasured, str]:
    """A new track from a position in the image, with the current parameters. BadInput if neither points nor image give
    its position."""
    if (act.bbox is None) == (act.pixel is None):
        raise BadAct("provide either a box or a pixel")
    if act.bbox is not None and not (act.bbox[0] < act.bbox[2] and act.bbox[1] < act.bbox[3]):
        raise BadAct("invalid box")
    found = lift(frame, params, canonical(act.label), act.bbox, act.pixel)
    cuboid, how = _given(found.cuboid), found.how
    return AddMeasured(kind="lift", label=act.label, frame=frame.index, cuboid=cuboid, bbox=found.bbox, how=how), how


def _given(cuboid: Cuboid) -> CuboidShape:
    """ActRefused for a cuboid that nobody could have drawn."""
    x, y, z = (round(value, DECIMALS) for value in cuboid.center)
    length, width, height = (round(value, DECIMALS) for value in cuboid.size)
    try:
        return CuboidShape(center=(x, y, z), size=(length, width, height), yaw_rad=round(cuboid.yaw_rad, DECIMALS))
    except ValidationError:
        raise ActRefused(f"the points there are {length:.0f} × {width:.0f} × {height:.0f} m: not a vehicle") from None
