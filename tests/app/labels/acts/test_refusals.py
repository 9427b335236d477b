"""Invalid changes are refused."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import ValidationError

from app.labels.acts.registry import do
from app.labels.acts.scope import Scope
from app.labels.errors import BadAct, NoSuchLabel
from app.labels.store.drive_labels import DriveLabels
from tests.app.labels.acts.doing import ACT, BOX, act
from tests.app.labels.conftest import COUNT


@pytest.mark.parametrize(
    "body",
    [
        {"kind": "tag", "first": 5, "last": 4, "tag": "night"},
        {"kind": "tag", "first": 5, "last": COUNT, "tag": "night"},
        {"kind": "set_sighting", "track": 1, "frame": COUNT, "cuboid": BOX},
        {"kind": "set_sighting", "track": 1, "frame": 3},
        {"kind": "set_sighting", "track": 1, "frame": 3, "bbox": [3, 3, 3, 9]},
        {"kind": "add_track", "label": "car", "frame": COUNT, "cuboid": BOX},
        {"kind": "set_lead", "first": 5, "last": 4, "lead": "none"},
        {"kind": "set_lead", "first": 5, "last": COUNT, "lead": "none"},
        {"kind": "set_path", "frame": 3, "left": None, "right": None},
        {"kind": "accept", "items": [("tag", 1)]},
        {"kind": "send_back", "items": [("tag", 1)], "comment": "it is another"},
    ],
)
def test_what_makes_no_sense_is_refused(labels: DriveLabels, body: dict[str, Any]) -> None:
    act(labels, kind="tag", first=1, last=1, tag="night")
    before = labels.revision
    with pytest.raises(BadAct):
        act(labels, **body)
    assert labels.revision == before


@pytest.mark.parametrize(
    "body",
    [
        {"kind": "set_lead", "first": 1, "last": 2, "lead": 77},
        {"kind": "relabel", "track": 77, "revision": 1, "label": "car"},
    ],
)
def test_what_is_not_there_is_said(labels: DriveLabels, body: dict[str, Any]) -> None:
    doing = ACT.validate_python(body)
    with pytest.raises(NoSuchLabel, match="there is no track 77"):
        labels.log.act(doing.kind, "Ada", lambda draft: do(draft, Scope(labels.info.t_ns), doing))


@pytest.mark.parametrize(
    "body",
    [
        {"kind": "explode"},
        {"kind": "relabel", "track": 1, "revision": 1, "label": " \n "},
        {"kind": "relabel", "track": 2**63, "revision": 1, "label": "car"},
        {"kind": "set_sighting", "track": 1, "revision": 1, "frame": 1, "cuboid": BOX | {"size": [0, 1, 1]}},
        {"kind": "set_sighting", "track": 1, "revision": 1, "frame": 1, "cuboid": BOX | {"yaw_rad": float("nan")}},
        {"kind": "accept", "items": []},
        {"kind": "send_back", "items": [{"kind": "track", "id": 1, "revision": 1}], "comment": " \n "},
        {"kind": "tag", "first": 1, "last": 1, "tag": "x", "extra": 1},
    ],
)
def test_a_form_that_is_none_is_not_taken(body: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        ACT.validate_python(body)
