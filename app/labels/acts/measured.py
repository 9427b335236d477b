"""Acts whose numbers come from the sensors' data instead of from a hand."""

from __future__ import annotations

from pydantic import ValidationError

from app.core.request_shapes import CuboidShape
from app.drive.open_recording import OpenRecording
from app.labels.acts.requests import AddMeasured, Lift, Refit, SetSighting
from app.labels.acts.scope import Scope
from app.labels.errors import ActRefused, BadAct
from app.labels.store.drive_labels import DriveLabels
from app.labels.wording import frames_text
from pipeline.common.geometry import Cuboid
from pipeline.labels.cuboid_from_pixel import lift
from pipeline.labels.model import LabelTrack
from pipeline.labels.snap import refit
from pipeline.params import Params
from pipeline.types import Frame
from pipeline.vision.classes import canonical

_DECIMALS = 4


def measured(
    labels: DriveLabels, recording: OpenRecording, params: Params, act: Refit | Lift
) -> tuple[SetSighting | AddMeasured, str]:
    """What is measured in the sensors' data for a person, as the act that it comes to, and how it was found. BadInput
    where there is nothing to measure."""
    Scope(labels.info.t_ns).check(act.frame)
    frame = recording.input(act.frame)
    return refitted(labels, frame, params, act) if isinstance(act, Refit) else lifted(frame, params, act)


def refitted(labels: DriveLabels, frame: Frame, params: Params, act: Refit) -> tuple[SetSighting, str]:
    """The track's cuboid in a frame laid on the points in and near it; where only the image shows it, on those seen
    in its box. ActRefused where it is not, or the image alone would tell how far it is; BadInput where there are too
    few points."""
    track = labels.track(act.track).value
    assert isinstance(track, LabelTrack)
    sighting = track.at(act.frame)
    if sighting is None:
        raise ActRefused(f"#{act.track} is not in {frames_text(act.frame)}")
    if frame.sweep is None:
        raise ActRefused(f"{frames_text(act.frame)} has no points")
    if sighting.cuboid is not None:
        found = refit(frame.sweep.points, sighting.cuboid)
        cuboid = found.cuboid
        note = f"fitted to {found.points} points" + ("" if found.turned else "; they do not show its heading")
    else:
        seen = lift(frame, params, track.label, sighting.bbox)
        if not seen.points:
            raise ActRefused(f"#{act.track}: {seen.how}; too rough for a label: draw it by hand")
        cuboid, note = seen.cuboid, seen.how
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


def lifted(frame: Frame, params: Params, act: Lift) -> tuple[AddMeasured, str]:
    """A new track from where something is in the image, with the parameters that are in use. BadInput where neither
    points nor image tell where it is."""
    if (act.bbox is None) == (act.pixel is None):
        raise BadAct("provide either a box or a pixel")
    if act.bbox is not None and not (act.bbox[0] < act.bbox[2] and act.bbox[1] < act.bbox[3]):
        raise BadAct("invalid box")
    found = lift(frame, params, canonical(act.label), act.bbox, act.pixel)
    cuboid, how = _given(found.cuboid), found.how
    return AddMeasured(kind="lift", label=act.label, frame=frame.index, cuboid=cuboid, bbox=found.bbox, how=how), how


def _given(cuboid: Cuboid) -> CuboidShape:
    """ActRefused for one that nobody could have drawn."""
    x, y, z = (round(value, _DECIMALS) for value in cuboid.center)
    length, width, height = (round(value, _DECIMALS) for value in cuboid.size)
    try:
        return CuboidShape(center=(x, y, z), size=(length, width, height), yaw_rad=round(cuboid.yaw_rad, _DECIMALS))
    except ValidationError:
        raise ActRefused(f"the points there are {length:.0f} × {width:.0f} × {height:.0f} m: not a vehicle") from None
