"""Routes and trajectories along the way."""

from __future__ import annotations

from math import pi
from pathlib import Path

import pytest

from pipeline.simulation.scenario import Scenario, ScenarioError
from pipeline.simulation.world.actors import motion
from tests.pipeline.simulation.openscenario.files import (
    Parts,
    at_time,
    condition,
    entity,
    event,
    init,
    lane,
    lane_action,
    on_lane,
    speed_action,
    story,
    xodr,
)

ROUTING = "<PrivateAction><RoutingAction>{}</RoutingAction></PrivateAction>"
ROUTE = ROUTING.format("<AssignRouteAction><Route>{}</Route></AssignRouteAction>")
WAYPOINT = "<Waypoint><Position>{}</Position></Waypoint>"
VERTEX = '<Vertex time="{}"><Position>{}</Position></Vertex>'
FOLLOW = ROUTING.format(
    "<FollowTrajectoryAction><TrajectoryRef><Trajectory><Shape><Polyline>{}</Polyline></Shape></Trajectory></TrajectoryRef>"
    '<TimeReference>{}</TimeReference><TrajectoryFollowingMode followingMode="position"/></FollowTrajectoryAction>'
)
TIMING = '<Timing domainAbsoluteRelative="{}" scale="1" offset="0"/>'


def follow(*vertices: tuple[float, str], domain: str = "relative") -> str:
    return FOLLOW.format("".join(VERTEX.format(t, where) for t, where in vertices), TIMING.format(domain))


def play(folder: Path, action: str, at_s: float = 1.0) -> Scenario:
    """The lead drives at 20 m/s from s = 150 on lane −1."""
    return Parts(
        init=init("Ego", on_lane(-1, 100.0), "20") + init("Lead", on_lane(-1, 150.0), "20"),
        stories=story(event("e", action, condition(at_time(at_s)))),
    ).load(folder)


def free_pose(made: Scenario, t_s: float) -> tuple[float, float, float]:
    """x, y and heading of the only free actor's centre."""
    x, y, heading = made.free_ways[0].to_world(made.free_actors[0].travelled_m(t_s), 0.0)[0].tolist()
    return x, y, heading


def places(made: Scenario, *times_s: float) -> list[tuple[float, float]]:
    """s and d of the lead's reference point."""
    moved = [motion(made.actors[0], made.road, t_s) for t_s in times_s]
    return [(150.0 + each.travelled_m, each.d_m) for each in moved]


def test_a_trajectory_is_driven_from_vertex_to_vertex(tmp_path: Path) -> None:
    """The action starts at 1 s, where the lead is at s = 170; its speed is constant between two vertices."""
    path = follow(
        (0.0, on_lane(-1, 170.0)), (2.0, on_lane(-1, 200.0)), (5.0, on_lane(-2, 260.0)), (8.0, on_lane(-2, 275.0))
    )
    made = play(tmp_path, path)
    expected = [(170.0, -1.75), (185.0, -1.75), (200.0, -1.75), (230.0, -3.5), (260.0, -5.25), (275.0, -5.25)]
    found = places(made, 1.0, 2.0, 3.0, 4.5, 6.0, 9.0)
    for (s_m, d_m), (s_wanted, d_wanted) in zip(found, expected, strict=True):
        assert s_m == pytest.approx(s_wanted, abs=0.05)
        assert d_m == pytest.approx(d_wanted, abs=0.01)


def test_times_of_a_trajectory_may_be_absolute(tmp_path: Path) -> None:
    path = follow((1.0, on_lane(-1, 170.0)), (4.0, on_lane(-1, 200.0)), domain="absolute")
    assert places(play(tmp_path, path), 4.0)[0][0] == pytest.approx(200.0, abs=0.05)


def test_a_trajectory_at_the_start_puts_the_vehicle_there(tmp_path: Path) -> None:
    parts = Parts(
        init=init("Ego", on_lane(-1, 100.0), "20")
        + init("Lead", on_lane(-1, 150.0), "20", follow((0.0, on_lane(-2, 160.0)), (4.0, on_lane(-2, 180.0))))
    )
    made = parts.load(tmp_path)
    assert made.actors[0].ahead_m == pytest.approx(160.0 - 150.0 + 46.0)
    assert made.actors[0].travelled_m(4.0) == pytest.approx(20.0, abs=0.05)


@pytest.mark.parametrize(
    ("action", "says"),
    [
        (follow((0.0, on_lane(-1, 180.0)), (2.0, on_lane(-1, 200.0))), "begins 10.0 m ahead of it, 0.0 m beside it"),
        (follow((0.0, on_lane(-2, 170.0)), (2.0, on_lane(-2, 200.0))), "begins 0.0 m ahead of it, -3.5 m beside it"),
        (follow((0.0, on_lane(-1, 170.0)), (2.0, on_lane(-1, 160.0))), "must lead ahead, with times that rise"),
        (follow((0.0, on_lane(-1, 170.0)), (0.0, on_lane(-1, 180.0))), "must lead ahead, with times that rise"),
        (follow((0.0, on_lane(-1, 170.0))), "needs 2 to 2000 points"),
        (ROUTE.format(""), "AssignRouteAction without positions is not supported"),
        (
            ROUTE.format(WAYPOINT.format('<LanePosition roadId="9" laneId="-1" s="1"/>')),
            "off the way of the ego vehicle",
        ),
        (
            ROUTE.format(WAYPOINT.format('<RelativeRoadPosition entityRef="Ego" ds="1" dt="0"/>')),
            "a route with a RelativeRoadPosition is not supported",
        ),
    ],
)
def test_what_is_refused(action: str, says: str, tmp_path: Path) -> None:
    lanes = f"<lanes><laneSection s='0'><right>{lane(-1)}</right></laneSection></lanes>"
    plan = '<geometry s="0" x="0" y="500" hdg="0" length="9"><line/></geometry>'
    parts = Parts(stories=story(event("e", action, condition(at_time(1.0)))))
    parts.road = xodr(more=f'<road id="9" length="9"><planView>{plan}</planView>{lanes}</road>')
    with pytest.raises(ScenarioError, match=says):
        parts.load(tmp_path)


def test_a_route_along_the_way_changes_nothing(tmp_path: Path) -> None:
    route = ROUTE.format(WAYPOINT.format(on_lane(-1, 170.0)) + WAYPOINT.format(on_lane(-1, 900.0)))
    acquired = ROUTING.format(
        f"<AcquirePositionAction><Position>{on_lane(-1, 900.0)}</Position></AcquirePositionAction>"
    )
    plain = play(tmp_path, speed_action("20"))
    for action in (route, acquired):
        made = play(tmp_path, action)
        assert places(made, 5.0)[0] == pytest.approx(places(plain, 5.0)[0])


ELSEWHERE = (
    '<road id="9" length="90"><planView><geometry s="0" x="0" y="500" hdg="0" length="90"><line/></geometry></planView>'
    f"<lanes><laneSection s='0'><right>{lane(-1)}</right></laneSection></lanes></road>"
)
FAR = '<LanePosition roadId="9" laneId="-1" s="9"/>'


def test_a_vehicle_on_an_unconnected_road_drives_there(tmp_path: Path) -> None:
    parts = Parts(entities=entity("Ego") + entity("Lead") + entity("Far") + entity("Parked"))
    parts.init += init("Far", FAR, "9") + init("Parked", FAR.replace('s="9"', 's="50"'))
    parts.road = xodr(more=ELSEWHERE)
    made = parts.load(tmp_path)
    assert len(made.actors) == 1
    far, parked = made.free_actors
    assert (far.s_m, far.d_m, far.heading_deg) == pytest.approx((9.0 + 1.5, 500.0 - 1.75, 0.0), abs=0.01)
    assert (parked.s_m, parked.d_m, parked.travelled_m(9.0)) == pytest.approx((50.0 + 1.5, 500.0 - 1.75, 0.0), abs=0.01)
    assert far.travelled_m(5.0) == pytest.approx(45.0)


def test_a_vehicle_that_comes_onto_the_way_merges(tmp_path: Path) -> None:
    """Road 9 leads through a quarter of a circle to the beginning of road 7."""
    parts = Parts(entities=entity("Ego") + entity("Side"))
    parts.init = init("Ego", on_lane(-1, 100.0), "20") + init("Side", FAR, "20")
    arc = f'<geometry s="0" x="-50" y="-50" hdg="{pi / 2}" length="{25 * pi}"><arc curvature="-0.02"/></geometry>'
    joined = '<link><successor elementType="road" elementId="7" contactPoint="start"/></link>'
    side = f"<lanes><laneSection s='0'><right>{lane(-1)}</right></laneSection></lanes></road>"
    parts.road = xodr(more=f'<road id="9" length="{25 * pi}">{joined}<planView>{arc}</planView>{side}')
    (merging,) = parts.load(tmp_path).free_actors
    states = [free_pose(parts.load(tmp_path), t_s) for t_s in (0.0, 9.0)]
    assert states[0][2] == pytest.approx(pi / 2 - 9 * 0.02, abs=0.05)
    assert states[1][1:] == pytest.approx((-1.75, 0.0), abs=0.02)
    assert merging.kind == "car"


def test_a_vehicle_on_a_bridge_is_left_out(tmp_path: Path) -> None:
    parts = Parts(entities=entity("Ego") + entity("Above"))
    parts.init = init("Ego", on_lane(-1, 100.0), "20") + init("Above", FAR, "9")
    height = '<elevationProfile><elevation s="0" a="{}" b="0" c="0" d="0"/></elevationProfile>'
    across = f'<geometry s="0" x="200" y="-40" hdg="{pi / 2}" length="90"><line/></geometry>'
    over = f'<road id="9" length="90"><planView>{across}</planView>'
    bridge = f"{over}{{}}<lanes><laneSection s='0'><right>{lane(-1)}</right></laneSection></lanes></road>"
    parts.road = xodr(more=bridge.format(height.format(6)))
    assert "Above is left out: it drives above or below the ego vehicle's road." in parts.load(tmp_path).notes
    parts.road = xodr(more=bridge.format(height.format(1)))
    assert len(parts.load(tmp_path).free_actors) == 1


def test_a_vehicle_on_a_road_that_cannot_be_simulated_is_refused_if_it_may_come(tmp_path: Path) -> None:
    parts = Parts(entities=entity("Ego") + entity("Far"))
    parts.init = init("Ego", on_lane(-1, 100.0), "20") + init("Far", FAR, "9")
    joined = '<link><successor elementType="road" elementId="7" contactPoint="start"/></link>'
    tight = ELSEWHERE.replace("<line/>", '<arc curvature="0.19"/>').replace('a="3.5"', 'a="5.5"')
    parts.road = xodr(more=tight)
    assert "Far is left out: road 9, where it drives, cannot be simulated." in parts.load(tmp_path).notes
    parts.road = xodr(more=tight.replace("<planView>", f"{joined}<planView>"))
    with pytest.raises(ScenarioError, match="Far may come onto road 7, which is on or across it"):
        parts.load(tmp_path)


def test_a_vehicle_whose_lane_shifts_follows_it_on_a_road_of_its_own(tmp_path: Path) -> None:
    """Lane −1 becomes 2 m wider between s = 200 and 300, so that lane −2 moves; the way follows lane −1."""
    growing = (
        '<lane id="-1" type="driving"><width sOffset="0" a="3.5" b="0" c="0" d="0"/>'
        '<width sOffset="200" a="3.5" b="0" c="0.0006" d="-0.000004"/>'
        '<width sOffset="300" a="5.5" b="0" c="0" d="0"/></lane>'
    )
    parts = Parts(
        init=init("Ego", on_lane(-1, 100.0), "20") + init("Lead", on_lane(-2, 150.0), "20"),
        road=xodr(lanes=f"<right>{growing}{lane(-2)}</right>"),
    )
    made = parts.load(tmp_path)
    assert made.actors == ()
    y_before, y_after = (free_pose(made, t_s)[1] for t_s in (1.0, 9.0))
    assert y_after - y_before == pytest.approx(-2.0, abs=0.03)
    turn = lane_action('<AbsoluteTargetLane value="-2"/>', value=2.0)
    parts.init = init("Ego", on_lane(-1, 100.0), "20") + init("Lead", on_lane(-1, 150.0), "20")
    assert parts.load(tmp_path).actors[0].offset_m == pytest.approx(0.0)
    parts.stories = story(event("e", turn))
    with pytest.raises(ScenarioError, match=r"the lanes of road 7 shift sideways by 0.\d m at s = 2\d\d m, where Lead"):
        parts.load(tmp_path)
