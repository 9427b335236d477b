"""Name tags of the 3D view, which do not cover each other."""

from __future__ import annotations

import math

import numpy as np
import viser.transforms

from app.views.viser.tags import NameTag, ViewCamera, arranged

AHEAD = viser.transforms.SO3.from_matrix(np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]))
"""A camera that looks along x, with z up."""
CAMERA = ViewCamera(np.zeros(3), AHEAD.wxyz, math.radians(60.0), 800.0, 600.0)


def tag(number: int, x: float, y: float, rank: int = 2) -> NameTag:
    return NameTag(f"#{number} car, accepted", f"#{number}", (x, y, 0.0), rank, 1.0)


def test_of_tags_that_would_cover_each_other_the_selected_one_is_shown_then_the_lead_then_the_nearest():
    near, far = tag(1, 20.0, 0.0), tag(2, 40.0, 0.0)
    assert arranged([far, near], CAMERA) == ["", "#1 car, accepted"]
    lead, chosen = far._replace(rank=1), far._replace(rank=0)
    assert arranged([near, lead], CAMERA) == ["", "#2 car, accepted"]
    assert arranged([lead, chosen], CAMERA) == ["", "#2 car, accepted"]


def test_a_tag_without_room_for_its_text_shows_its_number():
    assert arranged([tag(1, 20.0, 0.0), tag(2, 21.0, 3.0)], CAMERA) == ["#1 car, accepted", "#2"]
    assert arranged([tag(1, 20.0, 0.0), tag(2, 20.0, 8.0)], CAMERA) == ["#1 car, accepted", "#2 car, accepted"]


def test_what_is_behind_the_camera_or_beside_the_image_takes_no_room():
    assert arranged([tag(1, -20.0, 0.0), tag(2, 20.0, 40.0), tag(3, 20.0, 0.0)], CAMERA)[:2] == ["", ""]
    assert arranged([], CAMERA) == []


def test_nothing_is_arranged_before_the_size_of_the_image_is_known():
    unknown = ViewCamera(np.zeros(3), AHEAD.wxyz, 0.0, 0.0, 0.0)
    assert arranged([tag(1, 20.0, 0.0)], unknown) == [""]
