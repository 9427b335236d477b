"""Ways through networks: from road to road, through junctions, in both directions."""

from __future__ import annotations

from math import pi
from pathlib import Path

import pytest

from pipeline.simulation.openscenario.roads.building import driven_road
from pipeline.simulation.openscenario.roads.driven_road import DrivenRoad, OffTheWay
from pipeline.simulation.openscenario.roads.network import Network
from pipeline.simulation.openscenario.xml_files import read_xml
from tests.pipeline.simulation.openscenario.files import lane

LINE = '<geometry s="0" x="{}" y="{}" hdg="{}" length="{}"><line/></geometry>'
BOTH = f"<left>{lane(1)}</left><right>{lane(-1)}</right>"
ONE = f"<right>{lane(-1)}</right>"


def road(number: int, plan: str, length: float, links: str = "", lanes: str = BOTH, junction: int = -1) -> str:
    return (
        f'<road id="{number}" length="{length}" junction="{junction}"><link>{links}</link><planView>{plan}</planView>'
        f'<lanes><laneSection s="0">{lanes}</laneSection></lanes></road>'
    )


def link(kind: str, number: int, contact: str = "", to: str = "road") -> str:
    point = f'contactPoint="{contact}"' if contact else ""
    return f'<{kind} elementType="{to}" elementId="{number}" {point}/>'


def way(folder: Path, roads: str, start: str, lane_id: int = -1, wanted: str = "", s_m: float = 10.0) -> DrivenRoad:
    (folder / "a.xodr").write_text(f"<OpenDRIVE>{roads}</OpenDRIVE>")
    root = read_xml(folder / "a.xodr", "OpenDRIVE")
    network = Network(root)
    there = network.road(start, root)
    return driven_road(network, there, s_m, lane_id, there.traffic_way(lane_id), frozenset(wanted.split()))


TURNED = road(1, LINE.format(0, 0, 0, 100), 100, link("successor", 2, "end")) + road(
    2, LINE.format(180, 0, pi, 80), 80, link("successor", 1, "end")
)
"""Two roads that run towards each other."""


def test_a_road_that_runs_the_other_way_is_driven_against_its_direction(tmp_path: Path) -> None:
    made = way(tmp_path, TURNED, "1")
    assert [(track.road.id, track.way) for track in made.tracks] == [("1", 1), ("1", 1), ("2", -1)]
    assert made.length_m == pytest.approx(180.0)
    roads = made.network.roads
    assert made.place(roads["2"], 20.0, 1.75, made.network.at) == pytest.approx((160.0, -1.75, -1))
    assert made.lanes_at(160.0) == pytest.approx({1: -1.75, -1: 1.75})
    assert made.traffic_way(160.0, 1) == 1


def test_roads_behind_the_start_belong_to_the_way(tmp_path: Path) -> None:
    made = way(tmp_path, TURNED, "2", 1, s_m=50.0)
    assert made.place(made.network.roads["1"], 30.0, -1.75, made.network.at) == pytest.approx((30.0, -1.75, 1))
    assert made.place(made.network.roads["2"], 50.0, 1.75, made.network.at) == pytest.approx((130.0, -1.75, -1))


CROSSING = (
    road(1, LINE.format(0, 0, 0, 100), 100, link("successor", 9, to="junction"))
    + road(2, LINE.format(120, 0, 0, 50), 50, link("predecessor", 9, to="junction"))
    + road(3, LINE.format(110, -10, -pi / 2, 50), 50, link("predecessor", 9, to="junction"))
    + road(
        11,
        LINE.format(100, 0, 0, 20),
        20,
        link("predecessor", 1, "end") + link("successor", 2, "start"),
        BOTH,
        9,
    )
    + road(
        12,
        f'<geometry s="0" x="100" y="0" hdg="0" length="{5 * pi}"><arc curvature="-0.1"/></geometry>',
        5 * pi,
        link("predecessor", 1, "end") + link("successor", 3, "start"),
        ONE,
        9,
    )
    + '<junction id="9"/>'
)


def test_a_junction_is_crossed_straight_on_unless_the_route_turns(tmp_path: Path) -> None:
    straight = way(tmp_path, CROSSING, "1")
    assert [track.road.id for track in straight.tracks][-2:] == ["11", "2"]
    assert straight.notes[0] == "At junction 9 several roads go on; the vehicles take the straightest, road 11."
    turning = way(tmp_path, CROSSING, "1", wanted="3")
    assert [track.road.id for track in turning.tracks][-2:] == ["12", "3"]
    assert turning.to_file_world(turning.length_m, 0.0) == pytest.approx((110.0, -60.0), abs=0.02)
    with pytest.raises(OffTheWay, match="lies on road 2 at s = 5 m, off the way of the ego vehicle"):
        turning.place(turning.network.roads["2"], 5.0, -1.75, turning.network.at)


def test_a_way_follows_the_lane_that_joins_beside_others(tmp_path: Path) -> None:
    """The ramp's lane −1 continues as lane −2 of the main road, whose reference line lies 3.5 m to the left."""
    two = f"<left>{lane(1)}</left><right>{lane(-1)}{lane(-2)}</right>"
    joined = lane(-1).replace("<width", '<link><successor id="-2"/></link><width')
    roads = road(
        1, LINE.format(0, -3.5, 0, 100), 100, link("successor", 2, "start"), f"<right>{joined}</right>"
    ) + road(2, LINE.format(100, 0, 0, 100), 100, "", two)
    made = way(tmp_path, roads, "1")
    assert made.length_m == pytest.approx(200.0)
    assert made.lanes_at(50.0) == pytest.approx({-1: -1.75})
    assert made.lanes_at(150.0) == pytest.approx({-2: -1.75, -1: 1.75, 1: 5.25})


@pytest.mark.parametrize(
    "second",
    [
        road(2, LINE.format(101, 0, 0, 80), 80),
        road(2, LINE.format(100, 0, 0.2, 80), 80),
        road(2, LINE.format(100, 0, 0, 80).replace("line", "spring"), 80),
    ],
    ids=["gap", "kink", "unknown geometry"],
)
def test_a_way_ends_before_a_road_that_cannot_follow(second: str, tmp_path: Path) -> None:
    made = way(tmp_path, road(1, LINE.format(0, 0, 0, 100), 100, link("successor", 2, "start")) + second, "1")
    assert made.length_m == pytest.approx(100.0)


def test_a_ring_is_driven_once(tmp_path: Path) -> None:
    ring = f'<geometry s="0" x="0" y="0" hdg="0" length="{100 * pi}"><arc curvature="0.02"/></geometry>'
    made = way(tmp_path, road(1, ring, 100 * pi, link("successor", 1, "start") + link("predecessor", 1, "end")), "1")
    assert made.length_m == pytest.approx(100 * pi)
