"""Acts on a track's attributes: occlusion and truncation per frame, and others over ranges of frames."""

from __future__ import annotations

from dataclasses import replace

from app.labels.acts.requests import SetAttribute
from app.labels.acts.scope import Scope, corrected, track_of
from app.labels.errors import ActRefused, BadAct
from app.labels.store.draft import Draft
from app.labels.wording import frames_text
from pipeline.labels.classes import OF_SIGHTINGS
from pipeline.labels.model import Attribute, Sighting


def set_attribute(draft: Draft, scope: Scope, act: SetAttribute) -> str:
    """Replaces the attribute's values in these frames. BadAct if it is not in the class list."""
    scope.check(act.first, act.last)
    track = track_of(draft, act.track, act.revision)
    values = scope.classes.attributes.get(act.name)
    if values is None:
        raise BadAct(f"the class list has no attribute {act.name!r}")
    if act.value is not None and act.value not in values:
        raise BadAct(f"{act.name} must be one of {', '.join(values)}, not {act.value!r}")
    if act.name in OF_SIGHTINGS:
        there = draft.sightings(track.id, act.first, act.last)
        if not there:
            raise ActRefused(f"#{track.id} is not in {frames_text(act.first, act.last)}")
        draft.put_sightings(track.id, {frame: _said(each, act.name, act.value) for frame, each in there.items()})
        corrected(draft, track)
    else:
        corrected(draft, replace(track, attributes=_put(track.attributes, act)))
    said = act.value if act.value is not None else "not said"
    return f"#{track.id}: {act.name} {said} in {frames_text(act.first, act.last)}"


def _said(sighting: Sighting, name: str, value: str | None) -> Sighting:
    """BadAct for an invalid number: the class list may contain any text."""
    try:
        if name == "occlusion":
            return replace(sighting, occlusion=int(value) if value is not None else None)
        return replace(sighting, truncation=float(value) if value is not None else None)
    except ValueError:
        raise BadAct(f"{name} must be a number, not {value!r}") from None


def _put(known: tuple[Attribute, ...], act: SetAttribute) -> tuple[Attribute, ...]:
    """Other values of the attribute are cut; adjacent ranges with the same value are joined."""
    kept: list[Attribute] = []
    first, last = act.first, act.last
    for each in known:
        if each.name != act.name:
            kept.append(each)
            continue
        if each.value == act.value and each.first <= last + 1 and each.last >= first - 1:
            first, last = min(first, each.first), max(last, each.last)
            continue
        if each.first < act.first:
            kept.append(replace(each, last=min(each.last, act.first - 1)))
        if each.last > act.last:
            kept.append(replace(each, first=max(each.first, act.last + 1)))
    if act.value is not None:
        kept.append(Attribute(first, last, act.name, act.value))
    return tuple(sorted(kept, key=lambda each: (each.name, each.first)))
