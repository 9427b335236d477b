"""The effect of each kind of act on the labels of a drive."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from app.labels.acts import attributes, bulk_removal, frames, leads, review, shape, tags, tracks
from app.labels.acts.found import AddMeasured, AddSightings
from app.labels.acts.requests import (
    Accept,
    AddEvent,
    AddTrack,
    ClearAll,
    ClearLead,
    DropKeyframe,
    DropSightings,
    Flip,
    Merge,
    Reject,
    Relabel,
    Remove,
    RemovePath,
    ReviewOk,
    SendBack,
    SetAttribute,
    SetLead,
    SetPath,
    SetSighting,
    SizeAlong,
    Split,
    Tag,
    TrimLead,
)
from app.labels.acts.scope import Scope
from app.labels.store.draft import Draft

_ACTS: dict[type, Callable[[Draft, Scope, Any], str]] = {
    Accept: review.accept,
    Reject: review.reject,
    SendBack: review.send_back,
    ReviewOk: review.review_ok,
    Remove: review.remove,
    ClearAll: bulk_removal.clear_all,
    SetSighting: shape.set_sighting,
    DropKeyframe: shape.drop_keyframe,
    DropSightings: shape.drop_sightings,
    SizeAlong: shape.size_along,
    AddSightings: shape.add_sightings,
    Flip: shape.flip,
    AddTrack: tracks.add_track,
    AddMeasured: tracks.add_measured,
    Relabel: tracks.relabel,
    SetAttribute: attributes.set_attribute,
    Split: tracks.split,
    Merge: tracks.merge,
    SetLead: leads.set_lead,
    ClearLead: leads.clear_lead,
    TrimLead: leads.trim_lead,
    SetPath: frames.set_path,
    RemovePath: frames.remove_path,
    AddEvent: frames.add_event,
    Tag: tags.tag,
}


def do(draft: Draft, scope: Scope, act: Any) -> str:
    """Perform the act in the draft; returns a short description of what was done. ActRefused, NoSuchLabel or BadInput
    if it cannot be done."""
    return _ACTS[type(act)](draft, scope, act)
