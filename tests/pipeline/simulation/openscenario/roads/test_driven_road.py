"""Roads: lengths, bends and lanes as in the file, and what the simulator has not."""

from __future__ import annotations

from math import pi
from pathlib import Path

import numpy as np
import pytest

from pipeline.simulation.openscenario.roads.arc_fit import TOLERANCE_M
from pipeline.simulation.openscenario.roads.building import driven_road
from pipeline.simulation.openscenario.roads.driven_road import DrivenRoad
from pipeline.simulation.openscenario.roads.network import Network
from pipeline.simulation.openscenario.xml_files import OpenScenarioError, read_xml
from tests.pipeline.simulation.openscenario.files import LEFT, STRAIGHT, lane, xodr

QUARTER = 100.0 * pi / 2
BEND = (
    '<geometry s="0" x="10" y="20" hdg="0" length="50"><line/></geometry>'
    f'<geometry s="50" x="60" y="20" hdg="0" length="{QUARTER}"><arc curvature="0.01"/></geometry>'
    f'<geometry s="{50 + QUARTER}" x="160" y="120" hdg="{pi / 2}" length="30"><line/></geometry>'
)


def road(folder: Path, text: str, lane: int = -1, number: str = "7", s_m: float = 1.0) -> DrivenRoad:
    """The way from s = 1 m on a lane, in the direction of its traffic."""
    (folder / "a.xodr").write_text(text)
    root = read_xml(folder / "a.xodr", "OpenDRIVE")
    network = Network(root)
    start = network.road(number, root)
    return driven_road(network, start, s_m, lane, start.traffic_way(lane))


def test_lanes_keep_their_places(tmp_path: Path) -> None:
    made = road(tmp_path, xodr())
    assert made.lanes_at(9.0) == {-1: -1.75, -2: -5.25, 1: 1.75}
    assert (made.road.lanes_forward, made.road.lanes_oncoming, made.road.shoulder_m) == (2, 1, 1.5)
    assert [made.road.lane_offset_m(number) for number in (-1, -2, 1)] == [-1.75, -5.25, 1.75]
    assert (made.length_m, made.road.painted) == (2000.0, True)


def test_inner_lanes_without_traffic_are_the_median(tmp_path: Path) -> None:
    lanes = f"<left>{lane(1, 'median', 2.0)}{lane(2)}</left><right>{lane(-1, 'median', 2.0)}{lane(-2)}</right>"
    made = road(tmp_path, xodr(lanes=lanes), -2)
    assert made.lanes_at(9.0) == {-2: -3.75, 2: 3.75}
    assert made.road.lane_offset_m(-1) == -3.75
    assert made.road.median_m == 4.0


def test_a_proving_ground_has_wide_lanes_without_lines(tmp_path: Path) -> None:
    lanes = f"<right>{lane(-1, width=28.0, mark='none')}</right>"
    made = road(tmp_path, xodr(lanes=lanes))
    assert (made.road.lane_width_m, made.road.painted, made.road.lanes_oncoming) == (28.0, False, 0)


def test_a_bend_leads_where_the_file_says(tmp_path: Path) -> None:
    made = road(tmp_path, xodr(BEND))
    assert made.to_file_world(0.0, 0.0) == pytest.approx((10.0, 20.0))
    assert made.to_file_world(50.0 + QUARTER, 0.0) == pytest.approx((160.0, 120.0))
    assert made.to_file_world(80.0 + QUARTER, 2.0) == pytest.approx((158.0, 150.0))
    assert made.heading(60.0 + QUARTER) == pytest.approx(pi / 2)


@pytest.mark.parametrize("s_m", [0.0, 30.0, 49.9, 120.0, 200.0, 230.0])
@pytest.mark.parametrize("d_m", [-6.0, 0.0, 1.7])
def test_a_point_of_the_world_is_found_on_the_road(s_m: float, d_m: float, tmp_path: Path) -> None:
    made = road(tmp_path, xodr(BEND))
    assert made.project(*made.to_file_world(s_m, d_m)) == pytest.approx((s_m, d_m), abs=1e-6)


def test_a_spiral_turns_by_its_mean_curvature(tmp_path: Path) -> None:
    plan = '<geometry s="0" x="0" y="0" hdg="0.3" length="100"><spiral curvStart="0" curvEnd="0.01"/></geometry>'
    assert road(tmp_path, xodr(plan)).heading(100.0) == pytest.approx(0.3 + 0.5)


KINK = BEND.replace(f'hdg="{pi / 2}"', 'hdg="1.2"')
GAP = BEND.replace('x="160"', 'x="163"')
POLY = (
    '<geometry s="0" x="0" y="0" hdg="0" length="9"><paramPoly3 {} cU="0" dU="0" aV="0" bV="0" cV="0" dV="0"/>'
    "</geometry>"
)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        pytest.param(
            xodr(STRAIGHT.replace("line", "clothoid")), "clothoid is not supported; line, arc, spiral", id="unknown"
        ),
        pytest.param(xodr(POLY.format('aU="0" bU="0"')), "stands still or has a cusp", id="cusp"),
        pytest.param(
            xodr(POLY.format('aU="0" bU="20"')), "is 20 m long, but its length says 9 m", id="length of curve"
        ),
        pytest.param(xodr(KINK), "does not begin where the previous one ends", id="kink"),
        pytest.param(xodr(GAP), "does not begin where the previous one ends", id="gap"),
        pytest.param(xodr(""), "planView has no geometry", id="no geometry"),
        pytest.param(xodr(BEND.replace("0.01", "0.9")), "curvature_per_m: Input should be", id="too tight a bend"),
        pytest.param(
            xodr(STRAIGHT.replace("<line/>", '<arc curvature="0.19"/>')),
            "too tight for a road",
            id="too tight for its lanes",
        ),
        pytest.param(xodr(STRAIGHT.replace("2000", "-1")), "length_m: Input should be greater than 0", id="length"),
        pytest.param(xodr(STRAIGHT.replace("2000", "inf")), "length='inf' is not a number in range", id="endless"),
        pytest.param(xodr(STRAIGHT * 20_001), "does not begin where|too many geometries", id="too many"),
        pytest.param(xodr(lanes=f"<right>{lane(-2)}</right>"), "are not numbered from -1 outwards", id="numbers"),
    ],
)
def test_what_the_simulator_has_not_is_named(text: str, says: str, tmp_path: Path) -> None:
    with pytest.raises(OpenScenarioError, match=says) as error:
        road(tmp_path, text)
    assert str(error.value).startswith("a.xodr, line 1: ")


def test_a_constant_elevation_is_level(tmp_path: Path) -> None:
    level = '<elevationProfile><elevation s="0" a="520" b="0" c="0" d="0"/></elevationProfile>'
    assert np.isclose(road(tmp_path, xodr(inside=level)).length_m, 2000.0)


def test_lanes_of_unequal_width_keep_their_places(tmp_path: Path) -> None:
    """A motorway as many files have it, with an inner shoulder and a hard shoulder."""
    right = f"{lane(-1, 'border', 2.6)}{lane(-2, width=3.65)}{lane(-3, width=3.5)}{lane(-4, width=3.9)}"
    lanes = f"<left>{lane(1, width=4.0)}</left><right>{right}{lane(-5, 'stop', 2.85)}</right>"
    made = road(tmp_path, xodr(lanes=lanes), -3)
    assert made.lanes_at(9.0) == pytest.approx({-2: -4.425, -3: -8.0, -4: -11.7, 1: 2.0})
    assert [made.road.lane_offset_m(number) for number in (-1, -2, -3, 1)] == pytest.approx([-4.425, -8.0, -11.7, 2.0])
    assert (made.road.median_m, made.road.shoulder_m) == pytest.approx((2.6, 2.85))
    assert np.allclose(made.road.edges_m(), ((-13.65, -2.6), (0.0, 4.0)))


def test_a_lane_that_begins_outside_leaves_the_others_in_place(tmp_path: Path) -> None:
    opening = '<lane id="-2" type="driving"><width sOffset="0" a="0" b="0" c="0.0036" d="-0.000048"/></lane>'
    lanes = (
        f'{LEFT}<right>{lane(-1)}</right></laneSection><laneSection s="100">{LEFT}<right>{lane(-1)}{opening}</right>'
        f'</laneSection><laneSection s="150">{LEFT}<right>{lane(-1)}{lane(-2, width=3.0)}</right>'
    )
    made = road(tmp_path, xodr(lanes=lanes))
    assert [sorted(made.lanes_at(s)) for s in (50.0, 200.0)] == [[-1, 1], [-2, -1, 1]]
    assert made.lanes_at(200.0) == pytest.approx({-1: -1.75, -2: -5.0, 1: 1.75})
    assert made.road.lanes_forward == 1
    assert made.notes == ("Lanes are drawn as they are at the ego vehicle's start, along the whole road.",)


def test_an_offset_of_the_lanes_moves_the_reference_line(tmp_path: Path) -> None:
    """It grows from 0 to 3.5 m between s = 100 and 200; the ego vehicle's lane stays in the middle of the road."""
    offsets = (
        '<lanes><laneOffset s="0" a="0" b="0" c="0" d="0"/><laneOffset s="100" a="0" b="0" c="0.00105" d="-0.000007"/>'
        '<laneOffset s="200" a="3.5" b="0" c="0" d="0"/>'
    )
    made = road(tmp_path, xodr().replace("<lanes>", offsets))
    for s_file, t in ((50.0, 0.0), (150.0, 1.75), (300.0, 3.5)):
        along, across, way = made.place(made.network.roads["7"], s_file, t - 1.75, made.network.at)
        assert (across, way) == (pytest.approx(-1.75, abs=2 * TOLERANCE_M), 1)
        assert made.to_file_world(along, across) == pytest.approx((s_file, t - 1.75), abs=1e-6)


def test_a_road_driven_against_its_direction(tmp_path: Path) -> None:
    made = road(tmp_path, xodr(BEND), 1, s_m=200.0)
    length = 80.0 + QUARTER
    assert made.length_m == pytest.approx(length, abs=0.01)
    assert made.lanes_at(9.0) == pytest.approx({-1: 1.75, -2: 5.25, 1: -1.75})
    assert made.to_file_world(length, 0.0) == pytest.approx((10.0, 20.0), abs=2 * TOLERANCE_M)
    assert made.place(made.network.roads["7"], 30.0, 1.75, made.network.at) == pytest.approx((length - 30.0, -1.75, -1))


def test_left_hand_traffic_is_mirrored(tmp_path: Path) -> None:
    """A bend to the left becomes one to the right; the ego vehicle's side is the right."""
    made = road(tmp_path, xodr(BEND, of_road='rule="LHT"'), 1)
    assert made.lanes_at(9.0) == pytest.approx({-1: 1.75, -2: 5.25, 1: -1.75})
    assert made.road.curvature_per_m(100.0) == pytest.approx(-0.01)
    assert made.to_file_world(80.0 + QUARTER, -2.0) == pytest.approx((158.0, 150.0))
    assert made.project(158.0, 150.0) == pytest.approx((80.0 + QUARTER, -2.0))
    assert made.notes == ("The road has left-hand traffic; it is simulated as its mirror image, on the right.",)


def test_banked_roads_are_flat(tmp_path: Path) -> None:
    bank = '<lateralProfile><superelevation s="0" a="0.1" b="0" c="0" d="0"/></lateralProfile>'
    assert road(tmp_path, xodr(inside=bank)).notes == ("Superelevation of the road is left out: it is not banked.",)


PROFILE = '<elevationProfile><elevation s="0" a="0" b="{}" c="{}" d="0"/></elevationProfile>'


def test_a_slope_is_level_and_a_crest_is_a_crest(tmp_path: Path) -> None:
    """z = −s² / 4000 has the vertical radius 2000 m: 100 m ahead the road lies 2.5 m below the car's plane."""
    slope = road(tmp_path, xodr(inside=PROFILE.format(0.05, 0)))
    assert (slope.road.humps_per_m, slope.notes) == ((), ())
    crest = road(tmp_path, xodr(inside=PROFILE.format(0.05, -1 / 4000)))
    assert crest.notes == ()
    for s_m in (100.0, 1001.0, 1700.0):
        assert crest.road.hump_per_m(s_m) == pytest.approx(1 / 2000, rel=0.01)


def test_what_a_parabola_leaves_out_of_a_hill_is_said(tmp_path: Path) -> None:
    hill = (
        '<elevationProfile><elevation s="0" a="0" b="0" c="0" d="0"/>'
        '<elevation s="200" a="0" b="0" c="0.0036735" d="-0.00003498542"/><elevation s="270" a="6" b="0" c="0" d="0"/>'
        "</elevationProfile>"
    )
    (note,) = road(tmp_path, xodr(inside=hill)).notes
    assert note.startswith("The road's elevation is simulated as one crest or sag ahead of the car, within 2.")


def curve(rng: np.random.Generator, length_m: float) -> tuple[str, np.ndarray]:
    """A random polynomial as an element, and points on it in its own axes, from its definition."""
    bend, twist = rng.uniform(-0.004, 0.004), rng.uniform(-3e-5, 3e-5)
    u = np.linspace(0.0, 1.0, 200) * length_m
    v = u * u * (bend / 2 + twist * u)
    size_m = float(np.hypot(np.diff(u), np.diff(v)).sum())
    if rng.random() < 0.5:
        inside = f'<poly3 a="0" b="0" c="{bend / 2}" d="{twist}"/>'
    else:
        powers = f'cV="{bend / 2 * length_m**2}" dV="{twist * length_m**3}"'
        inside = f'<paramPoly3 pRange="normalized" aU="0" bU="{length_m}" cU="0" dU="0" aV="0" bV="0" {powers}/>'
    return f'length="{size_m}">{inside}', np.column_stack([u, v])


@pytest.mark.parametrize("seed", range(12))
def test_polynomials_lie_within_the_tolerance_of_their_definition(seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    element, points = curve(rng, rng.uniform(20.0, 120.0))
    x0, y0, turned = rng.uniform(-500, 500), rng.uniform(-500, 500), rng.uniform(-pi, pi)
    plan = f'<geometry s="0" x="{x0}" y="{y0}" hdg="{turned}" {element}</geometry>'
    made = road(tmp_path, xodr(plan))
    c, s = np.cos(turned), np.sin(turned)
    for u, v in points[::5].tolist():
        along, across = made.project(x0 + u * c - v * s, y0 + u * s + v * c)
        assert abs(across) <= TOLERANCE_M + 1e-6
        assert -0.01 <= along <= made.length_m + 0.01
