"""What the stream is told of a page for the 3D view: selection, labels, the cuboid that is held, and the frame."""

from __future__ import annotations

import json
from dataclasses import replace

from pipeline.common.geometry import Cuboid
from tests.app.streaming.stream_site import (
    Site,
    go_to,
    heard,
    next_header,
    texts,
)

CUBOID = {"center": [20, 0, 1], "size": [4, 2, 1.5], "yaw_rad": 0.5}
NAME, OTHER = "a" * 32, "b" * 32


def test_what_a_page_looks_at_is_heard_until_it_leaves(site: Site):
    looks = site.stream._looks
    label = {"track": 7, "cuboid": CUBOID, "text": "#7 car, accepted", "role": "fused", "facing": True}
    labels = {"labels": [label], "alone": True}
    with site.connected() as page:
        page.send(json.dumps({"page_3d": NAME, "selected": 7, "hides_3d": True, "labels_3d": labels}))
        heard(page)
        view = looks.view_of_name(NAME)
        assert (view.selected, looks.hiding) == (7, 1)
        assert view.labels is not None
        assert [each.text for each in view.labels.labels] == ["#7 car, accepted"]
        for nonsense in ('{"selected": "7"}', '{"selected": -1}', '{"selected": 1e400}', '{"hides_3d": 2}'):
            page.send(nonsense)
        heard(page)
        assert (looks.view_of_name(NAME).selected, looks.hiding) == (7, 1)
        page.send(json.dumps({"selected": None, "labels_3d": {**labels, "alone": 5}, "hides_3d": False}))
        heard(page)
        assert (looks.view_of_name(NAME).selected, looks.view_of_name(NAME).labels) == (None, None)
        page.send(json.dumps({"labels_3d": labels}))
        heard(page)
        assert looks.view_of_name(NAME).labels is not None
    with site.connected() as other:
        next_header(other)
        for _ in range(100):
            heard(other)
            if looks.view_of_name(NAME).labels is None:
                break
    assert looks.view_of_name(NAME).labels is None


def test_a_label_that_is_held_in_3d_is_followed_by_its_page_alone(site: Site):
    looks = site.stream._looks
    with site.connected() as page, site.connected() as other:
        page.send(json.dumps({"page_3d": NAME, "held": {"track": 7, "frame": 3, "cuboid": CUBOID}}))
        heard(page)
        held = looks.view_of_name(NAME).held
        assert held is not None
        assert (held.track, held.frame, held.cuboid) == (7, 3, Cuboid((20.0, 0.0, 1.0), (4.0, 2.0, 1.5), 0.5))
        other.send(json.dumps({"page_3d": OTHER, "held": {"track": 9, "frame": 3, "cuboid": CUBOID}}))
        heard(other)
        looks.drag(replace(held, cuboid=held.cuboid._replace(yaw_rad=1.0)), True)
        said = {"type": "held", "track": 7, "frame": 3, "cuboid": CUBOID | {"yaw_rad": 1.0}, "ended": True}
        assert next(message for message in texts(page) if message["type"] == "held") == said
        others = looks.view_of_name(OTHER).held
        assert (others and others.track) == 9, "the other's stays where it is"
        other.send(json.dumps({"held": None}))
        heard(other)
        assert looks.view_of_name(OTHER).held is None
        assert looks.view_of_name(NAME).held is not None, "another page holds nothing of this one's"
        looks.pick(NAME, 4)
        assert next(message for message in texts(page) if message["type"] == "selected")["id"] == 4
        assert looks.view_of_name(OTHER).selected is None
        for nonsense in ({"track": "7", "cuboid": 3}, {"track": 7, "cuboid": CUBOID}, 5):
            page.send(json.dumps({"held": nonsense}))
            heard(page)
            assert looks.view_of_name(NAME).held is None
            page.send(json.dumps({"held": {"track": 7, "frame": 3, "cuboid": CUBOID}}))
        heard(page)
        assert looks.view_of_name(NAME).held is not None


def test_the_3d_view_of_a_page_with_its_own_playhead_is_told_its_frame(site: Site):
    def told() -> str | None:
        shown = site.stream._looks.view_of_name(NAME).frame
        return None if shown is None else shown.result.frame

    with site.connected() as own:
        own.send(json.dumps({"page_3d": NAME}))
        go_to(own, 3)
        third = told()
        assert third not in (None, site.first.processed.result.frame)  # type: ignore[union-attr]
        site.show(5)
        heard(own)
        assert told() == third, "nobody moves it"
        go_to(own, 2)
        assert told() not in (None, third)
        own.send(json.dumps({"own": None}))
        heard(own)
        assert told() is None
