"""Roads: lengths, bends and lanes as in the file, and what the simulator has not."""

from __future__ import annotations

from math import pi
from pathlib import Path

import numpy as np
import pytest

from pipeline.simulation.openscenario.opendrive import DrivenRoad, road_of
from pipeline.simulation.openscenario.xml_files import OpenScenarioError, read_xml
from tests.pipeline.simulation.openscenario.files import LEFT, RIGHT, STRAIGHT, lane, xodr

QUARTER = 100.0 * pi / 2
BEND = (
    '<geometry s="0" x="10" y="20" hdg="0" length="50"><line/></geometry>'
    f'<geometry s="50" x="60" y="20" hdg="0" length="{QUARTER}"><arc curvature="0.01"/></geometry>'
    f'<geometry s="{50 + QUARTER}" x="160" y="120" hdg="{pi / 2}" length="30"><line/></geometry>'
)


def road(folder: Path, text: str, wanted: str | None = "7") -> DrivenRoad:
    (folder / "a.xodr").write_text(text)
    return road_of(read_xml(folder / "a.xodr", "OpenDRIVE"), wanted)


def test_lanes_keep_their_places(tmp_path: Path) -> None:
    made = road(tmp_path, xodr())
    assert made.lanes == {-1: -1.75, -2: -5.25, 1: 1.75}
    assert (made.road.lanes_forward, made.road.lanes_oncoming, made.road.shoulder_m) == (2, 1, 1.5)
    assert [made.road.lane_offset_m(number) for number in (-1, -2, 1)] == [-1.75, -5.25, 1.75]
    assert (made.length_m, made.road.painted) == (2000.0, True)


def test_inner_lanes_without_traffic_are_the_median(tmp_path: Path) -> None:
    lanes = f"<left>{lane(1, 'median', 2.0)}{lane(2)}</left><right>{lane(-1, 'median', 2.0)}{lane(-2)}</right>"
    made = road(tmp_path, xodr(lanes=lanes))
    assert made.lanes == {-2: -3.75, 2: 3.75}
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


def test_of_several_roads_the_named_one_is_taken(tmp_path: Path) -> None:
    lanes = f"<lanes><laneSection s='0'>{LEFT}</laneSection></lanes>"
    other = f'<road id="8" length="9"><planView>{STRAIGHT}</planView>{lanes}</road>'
    assert road(tmp_path, xodr(more=other)).id == "7"
    with pytest.raises(OpenScenarioError, match="no driving lane to the right"):
        road(tmp_path, xodr(more=other), "8")
    with pytest.raises(OpenScenarioError, match="2 roads; a position without roadId needs exactly one"):
        road(tmp_path, xodr(more=other), None)


KINK = BEND.replace(f'hdg="{pi / 2}"', 'hdg="1.2"')
GAP = BEND.replace('x="160"', 'x="163"')
TAPER = '<lane id="-1" type="driving"><width sOffset="0" a="3.5" b="0.01" c="0" d="0"/></lane>'
POLY = '<geometry s="0" x="0" y="0" hdg="0" length="9"><paramPoly3 aU="0" bU="1" cU="0" dU="0"/></geometry>'


@pytest.mark.parametrize(
    ("text", "says"),
    [
        pytest.param(xodr(POLY), "paramPoly3 is not supported; line, arc and spiral are", id="polynomial"),
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
        pytest.param(xodr(of_road='rule="LHT"'), "rule=LHT is not supported", id="left-hand traffic"),
        pytest.param(xodr(lanes=LEFT), "no driving lane to the right", id="left side alone"),
        pytest.param(xodr(lanes=f"<right>{TAPER}</right>"), "a lane must have one constant width", id="taper"),
        pytest.param(
            xodr(lanes=f"<right>{lane(-1)}{lane(-2, width=3.0)}</right>"), "lie side by side and have one", id="widths"
        ),
        pytest.param(
            xodr(lanes=f"<right>{lane(-1)}{lane(-2, 'biking')}{lane(-3)}</right>"), "lie side by side", id="apart"
        ),
        pytest.param(
            xodr(lanes=f"<left>{lane(1, width=3.0)}</left>{RIGHT}"), "of both sides must have one width", id="sides"
        ),
        pytest.param(xodr(lanes=f"<right>{lane(-2)}</right>"), "are not numbered from -1 outwards", id="numbers"),
        pytest.param(
            xodr(inside='<elevationProfile><elevation s="0" a="0" b="0.05" c="0" d="0"/></elevationProfile>'),
            "elevation is not supported",
            id="slope",
        ),
        pytest.param(
            xodr(inside='<lateralProfile><superelevation s="0" a="0.1" b="0" c="0" d="0"/></lateralProfile>'),
            "superelevation is not supported",
            id="bank",
        ),
        pytest.param(
            xodr().replace("<lanes>", '<lanes><laneOffset s="0" a="1" b="0" c="0" d="0"/>'),
            "laneOffset is not supported",
            id="lane offset",
        ),
        pytest.param(xodr(lanes=f'{RIGHT}</laneSection><laneSection s="9">{RIGHT}'), "2 lane sections", id="sections"),
        pytest.param(xodr().replace('id="7"', 'id="6"'), "no road '7'", id="no such road"),
    ],
)
def test_what_the_simulator_has_not_is_named(text: str, says: str, tmp_path: Path) -> None:
    with pytest.raises(OpenScenarioError, match=says) as error:
        road(tmp_path, text)
    assert str(error.value).startswith("a.xodr, line 1: ")


def test_a_constant_elevation_is_level(tmp_path: Path) -> None:
    level = '<elevationProfile><elevation s="0" a="520" b="0" c="0" d="0"/></elevationProfile>'
    assert np.isclose(road(tmp_path, xodr(inside=level)).length_m, 2000.0)
