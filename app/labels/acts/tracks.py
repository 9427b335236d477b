"""Acts on tracks: adding, naming, splitting and merging them."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

from app.labels.acts.found import AddMeasured
from app.labels.acts.requests import AddTrack, Merge, Relabel, Split
from app.labels.acts.scope import Scope, by_person, corrected, track_of
from app.labels.errors import ActRefused
from app.labels.store.draft import Draft
from app.labels.store.values import Frames
from app.labels.wording import frames_text
from pipeline.labels.model import Attribute, EventLabel, LabelTrack, LeadRange


def add_track(draft: Draft, scope: Scope, act: AddTrack) -> str:
    """Start a track with a cuboid or box drawn by hand."""
    scope.check(act.frame)
    number = draft.next_number("track")
    draft.add("track", LabelTrack(number, scope.classes.named(act.label), (), "corrected", by_person(draft)))
    draft.put_sightings(number, {act.frame: act.sighting()})
    return f"added #{number}, a {scope.classes.named(act.label)}, in {frames_text(act.frame)}"


def add_measured(draft: Draft, scope: Scope, act: AddMeasured) -> str:
    """Start a track where a person pointed; the measured position is a proposal until somebody accepts it."""
    scope.check(act.frame)
    number = draft.next_number("track")
    draft.add("track", LabelTrack(number, scope.classes.named(act.label), (), "proposed", by_person(draft, act.how)))
    draft.put_sightings(number, {act.frame: act.sighting()})
    return f"proposed #{number}, a {scope.classes.named(act.label)}, in {frames_text(act.frame)}"


def relabel(draft: Draft, scope: Scope, act: Relabel) -> str:
    """Change the class of a track."""
    track, label = track_of(draft, act.track, act.revision), scope.classes.named(act.label)
    corrected(draft, replace(track, label=label))
    return f"changed #{track.id} to {label}"


def split(draft: Draft, scope: Scope, act: Split) -> str:
    """Split a track. Lead ranges and events from that frame on refer to the new track."""
    scope.check(act.frame)
    track = track_of(draft, act.track, act.revision)
    there = draft.sightings(track.id)
    later: Frames = {frame: each for frame, each in there.items() if frame >= act.frame}
    if not later or len(later) == len(there):
        raise ActRefused(
            f"#{track.id} cannot be split at {frames_text(act.frame)}: it has labels on one side of that frame only"
        )
    number = draft.next_number("track")
    corrected(draft, track)
    draft.add("track", replace(track_of(draft, track.id), id=number, comment=""))
    draft.put_sightings(track.id, dict.fromkeys(later))
    draft.put_sightings(number, later)
    _share_attributes(draft, track, number, act.frame)
    _rename_from(draft, track.id, number, act.frame)
    return f"split #{track.id} at {frames_text(act.frame)}: from there it is #{number}"


def merge(draft: Draft, scope: Scope, act: Merge) -> str:
    """Join two tracks of one vehicle under the first id. In frames that both have, the first one's sighting is kept."""
    first, second = (track_of(draft, ref.id, ref.revision) for ref in act.tracks)
    if first.id == second.id:
        raise ActRefused("a track cannot be merged with itself")
    ours, theirs = draft.sightings(first.id), draft.sightings(second.id)
    draft.put_sightings(first.id, {frame: each for frame, each in theirs.items() if frame not in ours})
    corrected(draft, replace(first, attributes=_together(first.attributes, second.attributes)))
    _rename_from(draft, second.id, first.id, 0)
    draft.put("track", second.id, None)
    return f"merged #{second.id} into #{first.id}"


def _together(first: tuple[Attribute, ...], second: tuple[Attribute, ...]) -> tuple[Attribute, ...]:
    """Attributes of both; the second's apply where the first has no value."""
    more = [
        each
        for each in second
        if not any(one.name == each.name and one.first <= each.last and each.first <= one.last for one in first)
    ]
    return tuple(sorted((*first, *more), key=lambda each: (each.name, each.first)))


def _share_attributes(draft: Draft, track: LabelTrack, new: int, frame: int) -> None:
    """Attributes from a frame on move to the new track."""
    before = (replace(each, last=min(each.last, frame - 1)) for each in track.attributes if each.first < frame)
    after = (replace(each, first=max(each.first, frame)) for each in track.attributes if each.last >= frame)
    for number, said in ((track.id, tuple(before)), (new, tuple(after))):
        draft.put("track", number, replace(track_of(draft, number), attributes=said))


def _rename_from(draft: Draft, old: int, new: int, frame: int) -> None:
    """Let lead ranges and events refer to another track from a frame on."""
    for number, item in draft.all("lead").items():
        lead = cast("LeadRange", item.value)
        if lead.lead != old or lead.last < frame:
            continue
        if lead.first >= frame:
            draft.put("lead", number, replace(lead, lead=new))
        else:
            draft.put("lead", number, replace(lead, last=frame - 1))
            draft.add("lead", replace(lead, first=frame, lead=new))
    for number, item in draft.all("event").items():
        event = cast("EventLabel", item.value)
        if old in event.tracks and event.frame >= frame:
            renamed = tuple(dict.fromkeys(new if track == old else track for track in event.tracks))
            draft.put("event", number, replace(event, tracks=renamed))
