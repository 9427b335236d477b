"""The ground truth of a drive in the form that scores need: the lead in each frame, and every labelled vehicle with its
velocity.

A frame is *whole* when every vehicle in it is labelled; only there does an object without a label count as false. A
recording's own ground truth is always whole. A frame labelled by people is whole when no vehicle in it is only
proposed, and something confirms that all were labelled: accepted proposals there, imported truth, or a person's tag.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from pipeline.common.errors import BadInput
from pipeline.evaluation.lead_verdict import LABELLED_VEHICLES, LeadRule, true_lead
from pipeline.evaluation.scores.velocities import velocities
from pipeline.labels.link_identities import linked
from pipeline.labels.model import COUNTED_STATES, WHOLE_TAG, LabelSet, LabelTrack, LeadRange
from pipeline.sources.driven_way import DrivenWay
from pipeline.types import Box, Point2
from pipeline.types.source import Source, TruthObject

_NOT_FOLLOWED = (
    "The labels have no identities over time: vehicles are linked from frame to frame by distance. Identity scores "
    "depend on that, and speed is scored for leads only."
)


class NoTruth(BadInput):
    """A recording or file without labels to score against."""


@dataclass(frozen=True)
class FrameTruth:
    """A labelled frame."""

    t_ns: int
    """Its tick."""
    objects: tuple[TruthObject, ...]
    """Labelled vehicles with a position."""
    lead: TruthObject | None
    """None where there is none."""
    lead_known: bool = True
    """False if the lead is unclear, or its position is not labelled."""
    velocity_mps: Mapping[int, Point2] | None = None
    """Relative to ego in the rotating ego frame, by object id, if it can be derived from neighbouring frames; None if
    not computed."""
    lead_box: tuple[int, Box] | None = None
    """The lead's id and image box if it is labelled only in the image; then ``lead`` is None."""
    whole: bool = True
    """Whether every vehicle in it is labelled: only then does an additional object count as false."""
    unplaced: tuple[Box, ...] = ()
    """Image boxes of labelled vehicles whose position is unknown."""


@dataclass(frozen=True)
class DriveTruth:
    """The truth of one recording."""

    uri: str
    """Of the recording."""
    ticks: tuple[int, ...]
    """Of all its frames."""
    frames: Mapping[int, FrameTruth]
    """The labelled ones, by tick."""
    cut_ins: tuple[tuple[int, int], ...] | None = None
    """Tick and object of each labelled cut-in; None if they are not labelled and must be derived from the true
    leads."""
    notes: tuple[str, ...] = ()
    """What a user should know."""


def of_source(source: Source, rule: LeadRule) -> DriveTruth:
    """A recording's own labels. The lead is the nearest vehicle in the lane (``LeadRule``). NoTruth if no frame is
    labelled. Labels without ids are linked from frame to frame by distance."""
    ticks = tuple(source.t_ns(index) for index in range(len(source)))
    labelled = {tick: truth for index, tick in enumerate(ticks) if (truth := source.truth(index)) is not None}
    if not labelled:
        raise NoTruth(f"{source.uri}: no frame of this recording is labelled")
    frames = {tick: FrameTruth(tick, truth, true_lead(truth, rule)) for tick, truth in labelled.items()}
    followed = all(item.id is not None for truth in labelled.values() for item in truth)
    moving, notes = _over_time(frames, followed)
    return DriveTruth(source.uri, ticks, moving, None, notes)


def _over_time(frames: Mapping[int, FrameTruth], followed: bool) -> tuple[dict[int, FrameTruth], tuple[str, ...]]:
    """The frames with velocities, and sentences about velocities that are not scored. Labels without ids are linked by
    distance first."""
    if not followed:
        objects = linked({tick: frame.objects for tick, frame in frames.items()})
        frames = {tick: _renamed(frame, objects[tick]) for tick, frame in frames.items()}
    moving, jumps = with_velocities(frames)
    if not followed:
        moving = {tick: _only_the_leads(frame) for tick, frame in moving.items()}
        jumps = frozenset((tick, key) for tick, key in jumps if _lead_of(moving[tick]) == key)
    tracks = len({key for _, key in jumps})
    told = f"{tracks} {'track jumps' if tracks == 1 else 'tracks jump'} in {len(jumps)}"
    places = "place" if len(jumps) == 1 else "places"
    note = f"{told} {places} faster than any vehicle moves: speed is not scored there."
    return moving, (*(() if followed else (_NOT_FOLLOWED,)), *((note,) if jumps else ()))


def _lead_of(frame: FrameTruth) -> int | None:
    return frame.lead.id if frame.lead is not None else None


def _renamed(frame: FrameTruth, objects: tuple[TruthObject, ...]) -> FrameTruth:
    """The frame with new ids, in the same order."""
    lead = next((new for old, new in zip(frame.objects, objects, strict=True) if old is frame.lead), None)
    return replace(frame, objects=objects, lead=lead)


def _only_the_leads(frame: FrameTruth) -> FrameTruth:
    """Keep only the lead's velocity: objects beside the road are easily linked to their neighbours."""
    kept = {key: velocity for key, velocity in (frame.velocity_mps or {}).items() if key == _lead_of(frame)}
    return replace(frame, velocity_mps=kept)


def of_labels(labels: LabelSet, rule: LeadRule, way: Callable[[], DrivenWay | None] | None = None) -> DriveTruth:
    """Labels made by people. Only labels that were accepted by a person or imported count: an unreviewed proposal is
    the pipeline's own output. If no lead is labelled at all, it is the nearest vehicle in the lane (``LeadRule``), in
    completely labelled frames. NoTruth if nothing counts. If all tracks have only one frame, they are linked by
    distance.

    way: of the recording, which is asked for only where no lead is labelled; without it, the lane is straight.
    """
    tracks = {track.id: track for track in labels.tracks if track.state in COUNTED_STATES}
    ranges = [each for each in labels.leads if each.state in COUNTED_STATES]
    objects, unplaced = _objects_by_frame(tracks), _unplaced_by_frame(tracks)
    left = _left_proposed(labels)
    whole = _said_whole(labels) - left
    driven = way() if way is not None and objects and not ranges else None
    covered = {index for each in ranges for index in range(each.first, each.last + 1)}
    frames = {}
    for index in sorted((objects.keys() | covered) & set(range(len(labels.t_ns)))):
        items, tick = objects.get(index, ()), labels.t_ns[index]
        items = driven.placed(tick, items) if driven is not None else items
        known = FrameTruth(tick, items, None, whole=index in whole, unplaced=unplaced.get(index, ()))
        if not ranges:
            frames[tick] = replace(known, lead=true_lead(items, rule), lead_known=known.whole)
            continue
        said = next((each.lead for each in ranges if each.first <= index <= each.last), None)
        lead = next((item for item in items if item.id == said), None)
        box = _box_of(tracks.get(said), index) if lead is None and isinstance(said, int) else None
        is_known = lead is not None or box is not None or said == "none"
        frames[tick] = replace(known, lead=lead, lead_known=is_known, lead_box=box)
    if not frames:
        raise NoTruth(f"{labels.source}: none of these labels is accepted")
    events = [each for each in labels.events if each.kind == "cut_in" and each.state in COUNTED_STATES and each.tracks]
    cut_ins = tuple((labels.t_ns[each.frame], each.tracks[0]) for each in events) or None
    followed = len(frames) < 2 or any(len(track.sightings) > 1 for track in tracks.values()) or not tracks
    moving, of_motion = _over_time(frames, followed)
    left_in = sum(labels.t_ns[index] in frames for index in left)
    notes = (*_notes(labels, ranges, frames, left_in), *of_motion)
    return DriveTruth(labels.source, labels.t_ns, moving, cut_ins, notes)


def _notes(labels: LabelSet, ranges: Sequence[LeadRange], frames: Mapping[int, FrameTruth], left: int) -> list[str]:
    """What is not counted, and why. left: frames with a vehicle that is only proposed."""
    proposed = {track.id for track in labels.tracks if track.state == "proposed"}
    notes = []
    for lead in sorted({each.lead for each in ranges if isinstance(each.lead, int) and each.lead in proposed}):
        count = sum(each.last - each.first + 1 for each in ranges if each.lead == lead)
        frames_text = f"{count} {'frame' if count == 1 else 'frames'}"
        notes.append(f"#{lead} leads in {frames_text} but is only proposed: not scored until accepted.")
    if proposed:
        notes.append(f"{len(proposed)} of {len(labels.tracks)} tracks are only proposed and do not count.")
    own, places = _as_proposed(labels)
    if own:
        notes.append(
            f"{own} of {places} labelled positions are unchanged proposals: there the pipeline is compared with itself."
        )
    whole = sum(frame.whole for frame in frames.values())
    if whole == len(frames):
        return notes
    if not ranges:
        notes.append("No lead is labelled: the choice of the lead is scored only where every vehicle is labelled.")
    unsaid = len(frames) - whole - left
    why = [
        f"In {left} a vehicle is only proposed: accept or reject it." if left else "",
        f"Not confirmed as fully labelled: {unsaid}. Tag them “{WHOLE_TAG}”." if unsaid else "",
    ]
    judged = f"Detection and tracking are scored in {whole} of {len(frames)} labelled frames."
    notes.append(" ".join((judged, *filter(None, why))))
    return notes


def _as_proposed(labels: LabelSet) -> tuple[int, int]:
    """(cuboids accepted unchanged from the pipeline, all cuboids that count)."""
    counted = [track for track in labels.tracks if track.state in COUNTED_STATES]
    placed = {track.id: sum(each.cuboid is not None for each in track.sightings) for track in counted}
    return sum(placed[track.id] for track in counted if track.origin.maker == "pipeline"), sum(placed.values())


def _said_whole(labels: LabelSet) -> set[int]:
    """The frames that are confirmed to be completely labelled."""
    asked = {frame for tag in labels.tags if tag.tag == WHOLE_TAG for frame in range(tag.first, tag.last + 1)}
    for lead in labels.leads:
        if lead.origin.maker == "pipeline":
            asked.update(range(lead.first, lead.last + 1))
    for track in labels.tracks:
        if track.state != "proposed" and track.origin.maker != "person":
            asked.update(each.frame for each in track.sightings)
    return asked


def _left_proposed(labels: LabelSet) -> set[int]:
    """The frames with an unreviewed vehicle."""
    left = [track for track in labels.tracks if track.state == "proposed" and track.label.lower() in LABELLED_VEHICLES]
    return {each.frame for track in left for each in track.sightings}


def _box_of(track: LabelTrack | None, index: int) -> tuple[int, Box] | None:
    seen = track.at(index) if track is not None else None
    return (track.id, seen.bbox) if track is not None and seen is not None and seen.bbox is not None else None


def _objects_by_frame(tracks: Mapping[int, LabelTrack]) -> dict[int, tuple[TruthObject, ...]]:
    found: dict[int, tuple[TruthObject, ...]] = {}
    for track in tracks.values():
        for seen in track.sightings:
            item = (TruthObject(track.label, seen.cuboid, track.id),) if seen.cuboid is not None else ()
            found[seen.frame] = (*found.get(seen.frame, ()), *item)
    return found


def _unplaced_by_frame(tracks: Mapping[int, LabelTrack]) -> dict[int, tuple[Box, ...]]:
    """Boxes of vehicles labelled only in the image."""
    found: dict[int, tuple[Box, ...]] = {}
    for track in tracks.values():
        for seen in track.sightings:
            if seen.cuboid is None and seen.bbox is not None:
                found[seen.frame] = (*found.get(seen.frame, ()), seen.bbox)
    return found


def with_velocities(frames: Mapping[int, FrameTruth]) -> tuple[dict[int, FrameTruth], frozenset[tuple[int, int]]]:
    """Each frame with its objects' velocities; tick and object of each jump."""
    places = {
        tick: {item.id: item.cuboid.center[:2] for item in frames[tick].objects if item.id is not None}
        for tick in frames  # in recorded order: two clips may overlap in time
    }
    found = velocities(places.items())
    return {tick: replace(frames[tick], velocity_mps=found.mps.get(tick, {})) for tick in places}, found.jumps
