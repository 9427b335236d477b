"""Colours, words and outlines that the 3D views share."""

from __future__ import annotations

import dataclasses
import re
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.views import scene
from app.views.colors import PALETTE, palette_css, rgb, role_of, shade_of
from pipeline.common.geometry import Cuboid
from pipeline.types import GROUND, UNCLUSTERED, Layers, Result

BACKGROUNDS = {"dark": (13, 17, 23), "light": (255, 255, 255)}


def contrast(a: tuple[int, int, int], b: tuple[int, int, int]) -> float:
    """WCAG 2.1 contrast ratio."""

    def luminance(color: tuple[int, int, int]) -> float:
        level = np.asarray(color) / 255.0
        light = np.where(level <= 0.04045, level / 12.92, ((level + 0.055) / 1.055) ** 2.4)
        return float(light @ [0.2126, 0.7152, 0.0722])

    high, low = sorted((luminance(a), luminance(b)), reverse=True)
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("theme", ["dark", "light"])
@pytest.mark.parametrize("role", ["lidar", "vision", "fused", "cipv", "path", "warning"])
def test_what_matters_reads_on_both_backgrounds(role: str, theme: str) -> None:
    assert contrast(rgb(role, theme), BACKGROUNDS[theme]) >= 4.5  # type: ignore[arg-type]


@pytest.mark.parametrize(("a", "b"), list(combinations(["lidar", "vision", "fused", "cipv"], 2)))
def test_sources_can_be_told_apart(a: str, b: str) -> None:
    assert np.linalg.norm(np.subtract(rgb(a), rgb(b))) > 80  # type: ignore[arg-type]


def test_css_has_every_colour_of_the_palette() -> None:
    dark, light = (dict(re.findall(r"--cipv-(\w+): (#[0-9a-f]{6});", palette_css(it))) for it in ("dark", "light"))
    assert dark == {role: shades.dark for role, shades in PALETTE.items()}
    assert light == {role: shades.light for role, shades in PALETTE.items()}


def test_shades_are_stable_and_never_brighter() -> None:
    assert shade_of((200, 100, 50), 7) == shade_of((200, 100, 50), 7) != shade_of((200, 100, 50), 8)
    assert all(np.less_equal(shade_of((200, 100, 50), n), (200, 100, 50)).all() for n in range(9))


def test_role_of_each_source_and_of_the_cipv(result: Result) -> None:
    assert [role_of(each, 7) for each in result.objects] == ["cipv", "lidar", "vision", "vision"]
    assert role_of(result.objects[0], None) == "fused"


def test_points_take_the_colour_of_what_they_belong_to(result: Result) -> None:
    colors, kind = scene.point_colors(result), result.layers.kind
    expected = {
        GROUND: rgb("ground"),
        UNCLUSTERED: rgb("unclustered"),
        0: shade_of(rgb("cipv"), 7),
        1: shade_of(rgb("lidar"), 8),
    }
    for value, color in expected.items():
        assert (colors[kind == value] == color).all()


def test_a_cluster_that_no_object_owns_has_a_colour_of_its_own(result: Result) -> None:
    orphan = dataclasses.replace(result, objects=result.objects[1:], cipv=None)
    assert (scene.point_colors(orphan)[result.layers.kind == 0] == rgb("cluster")).all()


@pytest.mark.parametrize("by", ["kind", "height", "intensity", "range"])
def test_every_point_has_a_colour_and_no_points_have_none(result: Result, by: scene.ColorBy) -> None:
    colors = scene.point_colors(result, by)
    assert colors.shape == (len(result.layers.points), 3)
    assert colors.dtype == np.uint8
    empty = dataclasses.replace(result, layers=Layers(np.zeros((0, 4), np.float32), np.zeros(0, np.int32)))
    assert scene.point_colors(empty, by).shape == (0, 3)


def test_range_colours_run_from_blue_to_red() -> None:
    near, far = scene.range_colors(np.array([5.0, 75.0]))
    assert near[2] > near[0]
    assert far[0] > far[2]


def test_words_say_what_is_unknown_and_what_is_carried(result: Result) -> None:
    assert [scene.object_text(each) for each in result.objects] == [
        "#7 car 19.9 m",
        "#8 obstacle 15.9 m",
        "#9 truck 45.0 m carried",
        "#10 person ? m",
    ]


def test_ground_height_is_the_sweeps_own_or_unknown(result: Result) -> None:
    assert scene.ground_height_m(result) == pytest.approx(-1.2)
    blind = dataclasses.replace(result, layers=Layers(np.zeros((0, 4), np.float32), np.zeros(0, np.int32)))
    assert scene.ground_height_m(blind) is None


@given(yaw=st.floats(-3.2, 3.2), size=st.tuples(*[st.floats(0.1, 10.0)] * 3))
def test_cuboid_edges_have_the_cuboids_lengths(yaw: float, size: tuple[float, float, float]) -> None:
    edges = scene.cuboid_edges(Cuboid((5.0, -2.0, 1.0), size, yaw))
    lengths = np.linalg.norm(edges[:, 0] - edges[:, 1], axis=1)
    assert np.allclose(np.sort(lengths), np.sort(np.repeat(size, 4)))


def test_outline_is_closed_and_absent_without_a_place(result: Result) -> None:
    outline = scene.flat_outline(result.objects[2], -1.0)
    assert outline is not None
    assert (outline[0] == outline[-1]).all()
    assert (outline[:, 2] == -1.0).all()
    assert scene.flat_outline(result.objects[3], -1.0) is None


def test_ribbon_covers_the_corridor(result: Result) -> None:
    vertices, faces = scene.ribbon(result.path, -1.2)
    a, b, c = (vertices[faces[:, k], :2] for k in range(3))
    (abx, aby), (acx, acy) = (b - a).T, (c - a).T
    area = np.abs(abx * acy - aby * acx).sum() / 2
    assert area == pytest.approx(3.0 * 60.0, rel=1e-6)


def test_ribbon_of_a_path_without_length_is_empty(result: Result) -> None:
    short = dataclasses.replace(result.path, left=result.path.left[:1], right=result.path.right[:1])
    assert len(scene.ribbon(short, 0.0)[1]) == 0
