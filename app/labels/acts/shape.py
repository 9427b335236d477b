"""Acts on the geometry of a track: keyframes, sizes, and frames without it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from app.labels.acts.found import AddSightings
from app.labels.acts.requests import DropKeyframe, DropSightings, Flip, SetSighting, SizeAlong
from app.labels.acts.scope import Scope, corrected, track_of
from app.labels.errors import ActRefused
from app.labels.store.draft import Draft
from app.labels.wording import frames_text
from pipeline.labels import interpolate
from pipeline.labels.headings import half_turned
from pipeline.labels.model import Sighting


def set_sighting(draft: Draft, scope: Scope, act: SetSighting) -> str:
    """Place a track in a frame by hand. The frame becomes a keyframe, and those between keyframes follow."""
    scope.check(act.frame)
    track = track_of(draft, act.track, act.revision)
    old = draft.sightings(track.id)
    new = _with_what_was_said(act.sighting(), old.get(act.frame))
    after = interpolate.put_keyframe(old, new, scope.t_ns, interpolate=act.interpolate)
    _put(draft, track.id, old, after)
    before = old.get(act.frame)
    placed = before is None or before.cuboid != new.cuboid
    corrected(draft, replace(track, heading="") if placed else track, placed=placed)
    return f"{_verb(before, new)} #{track.id} in {frames_text(act.frame)}"


def drop_keyframe(draft: Draft, scope: Scope, act: DropKeyframe) -> str:
    """Interpolate a frame again that was set by hand. ActRefused if it is not a keyframe."""
    track = track_of(draft, act.track, act.revision)
    old = draft.sightings(track.id)
    if act.frame not in old or not old[act.frame].keyframe:
        raise ActRefused(f"#{track.id} has no keyframe in {frames_text(act.frame)}")
    _put(draft, track.id, old, interpolate.drop_keyframe(old, act.frame, scope.t_ns))
    corrected(draft, track)
    return f"interpolated #{track.id} in {frames_text(act.frame)}"


def drop_sightings(draft: Draft, scope: Scope, act: DropSightings) -> str:
    """Remove a track from a range of frames. ActRefused if it is in none of them."""
    scope.check(act.first, act.last)
    track = track_of(draft, act.track, act.revision)
    there = draft.sightings(track.id, act.first, act.last)
    if not there:
        raise ActRefused(f"#{track.id} is not in {frames_text(act.first, act.last)}")
    draft.put_sightings(track.id, dict.fromkeys(there))
    corrected(draft, track)
    return f"removed #{track.id} from {frames_text(act.first, act.last)}"


def size_along(draft: Draft, scope: Scope, act: SizeAlong) -> str:
    """Give every cuboid of a track the same length, width and height, metres."""
    track = track_of(draft, act.track, act.revision)
    old = draft.sightings(track.id)
    after = {
        frame: replace(each, cuboid=interpolate.resized(each.cuboid, act.size)) if each.cuboid is not None else each
        for frame, each in old.items()
    }
    if not any(each.cuboid is not None for each in old.values()):
        raise ActRefused(f"#{track.id} has no cuboid in any frame")
    _put(draft, track.id, old, after)
    corrected(draft, track)
    return "resized #{} to {} m in every frame".format(track.id, " × ".join(f"{side:.2f}" for side in act.size))


def add_sightings(draft: Draft, scope: Scope, act: AddSightings) -> str:
    """Add sightings in frames without one; none of them becomes a keyframe."""
    track = track_of(draft, act.track, act.revision)
    old = draft.sightings(track.id)
    new = {each.frame: replace(each.sighting(), keyframe=False) for each in act.sightings if each.frame not in old}
    if not new:
        raise ActRefused(f"#{track.id} was not found before its first or after its last frame")
    scope.check(min(new), max(new))
    draft.put_sightings(track.id, dict(new))
    corrected(draft, track)
    return f"extended #{track.id} by {len(new)} frames, to {frames_text(min(*new, *old), max(*new, *old))}"


def flip(draft: Draft, scope: Scope, act: Flip) -> str:
    """Reverse the heading of a track in every frame."""
    track = track_of(draft, act.track, act.revision)
    old = draft.sightings(track.id)
    after = {
        frame: replace(each, cuboid=half_turned(each.cuboid)) for frame, each in old.items() if each.cuboid is not None
    }
    if not after:
        raise ActRefused(f"#{track.id} has no cuboid in any frame")
    _put(draft, track.id, old, {**old, **after})
    corrected(draft, replace(track, heading=""))
    return f"reversed #{track.id} in every frame"


def _put(draft: Draft, track: int, old: Mapping[int, Sighting], new: Mapping[int, Sighting]) -> None:
    """Store the frames that differ."""
    changed: dict[int, Sighting | None] = {frame: each for frame, each in new.items() if old.get(frame) != each}
    changed.update(dict.fromkeys(old.keys() - new.keys()))
    draft.put_sightings(track, changed)


def _with_what_was_said(new: Sighting, old: Sighting | None) -> Sighting:
    """Keep the properties that moving the track does not change. An imported truncation applies only to the original
    shape."""
    if old is None:
        return new
    is_same = (old.cuboid, old.bbox) == (new.cuboid, new.bbox)
    return replace(new, occlusion=old.occlusion, truncation=old.truncation if is_same else None)


def _verb(old: Sighting | None, new: Sighting) -> str:
    if old is None:
        return "placed"
    if (old.cuboid, old.bbox) == (new.cuboid, new.bbox):
        return "held" if old.box_set == new.box_set else "boxed"
    if old.cuboid is None or new.cuboid is None or old.cuboid == new.cuboid:
        return "boxed" if old.bbox != new.bbox else "placed"
    if old.cuboid.center != new.cuboid.center and old.cuboid.size == new.cuboid.size:
        return "moved"
    if old.cuboid.size != new.cuboid.size:
        return "resized"
    return "turned"
