"""Vehicles on other roads than the ego vehicle's: crossing it, on routes, turning off; and how such roads are drawn."""

from __future__ import annotations

from math import cos, pi
from pathlib import Path

import numpy as np
import pytest

from pipeline.simulation.scenario import ScenarioError
from pipeline.simulation.world import world_state
from tests.pipeline.simulation.openscenario.files import (
    Parts,
    at_time,
    condition,
    entity,
    event,
    init,
    lane,
    on_lane,
    speed_action,
    story,
    vehicle,
    xodr,
)
from tests.pipeline.simulation.openscenario.walkers import (
    pose,
)

# ---------------------------------------------------------------- a crossing of roads 7 (east) and 8 (north)

NORTH = f'<geometry s="0" x="300" y="-100" hdg="{pi / 2}" length="200"><line/></geometry>'
ROAD_8 = (
    f'<road id="8" length="200" junction="-1"><planView>{NORTH}</planView><lanes><laneSection s="0">'
    f"<left>{lane(1)}</left><right>{lane(-1)}</right></laneSection></lanes></road>"
)
ROUTE = (
    "<Route name='r' closed='false'><Waypoint routeStrategy='shortest'><Position>{}</Position></Waypoint>"
    "<Waypoint routeStrategy='shortest'><Position>{}</Position></Waypoint></Route>"
)
SOUTH = ROUTE.format('<LanePosition roadId="8" laneId="1" s="190"/>', '<LanePosition roadId="8" laneId="1" s="10"/>')
ON_ROUTE = "<RoutePosition><RouteRef>{}</RouteRef><InRoutePosition>{}</InRoutePosition></RoutePosition>"


def crossing(where: str, *actions: str, stories: str = "") -> Parts:
    return Parts(
        entities=entity("Ego") + entity("Other", vehicle("bicycle", centre=0.0)),
        init=init("Ego", on_lane(-1, 100.0), "10") + init("Other", where, None, "".join(actions)),
        stories=stories,
        road=xodr(more=ROAD_8),
    )


def test_a_vehicle_crosses_on_its_own_road(tmp_path: Path) -> None:
    made = crossing('<LanePosition roadId="8" laneId="-1" s="50"/>', speed_action("5")).load(tmp_path)
    assert pose(made, 0.0) == pytest.approx((301.75, -50.0, pi / 2), abs=1e-3)
    assert pose(made, 10.0) == pytest.approx((301.75, 0.0, pi / 2), abs=1e-3)


def test_it_may_change_lanes_there(tmp_path: Path) -> None:
    offset = (
        '<PrivateAction><LateralAction><LaneOffsetAction continuous="false"><LaneOffsetActionDynamics '
        'dynamicsShape="sinusoidal" maxLateralAcc="2"/><LaneOffsetTarget><AbsoluteTargetLaneOffset value="1"/>'
        "</LaneOffsetTarget></LaneOffsetAction></LateralAction></PrivateAction>"
    )
    stories = story(event("e", offset, condition(at_time(1.0))), actors="Other")
    made = crossing('<LanePosition roadId="8" laneId="-1" s="50"/>', speed_action("5"), stories=stories).load(tmp_path)
    assert pose(made, 9.0) == pytest.approx((300.75, -5.0, pi / 2), abs=0.1)


def test_a_place_relative_to_a_turned_vehicle_counts_along_it(tmp_path: Path) -> None:
    """A parked car faces north on road 8; another stands 5 m behind it and 1 m to its left."""
    parts = crossing('<LanePosition roadId="8" laneId="-1" s="85"/>')
    parts.entities += entity("Behind", vehicle(centre=0.0))
    parts.init += init("Behind", '<RelativeObjectPosition entityRef="Other" dx="-5" dy="1"/>')
    made = parts.load(tmp_path)
    assert made.actors == ()
    states = {state.actor.id: state.cuboid for state in world_state.at(made, 0.0).actors}
    assert np.subtract(states[2].center[:2], states[1].center[:2]) == pytest.approx((-1.0, -5.0))
    assert states[2].yaw_rad == pytest.approx(pi / 2)


@pytest.mark.parametrize(
    ("where", "x"),
    [
        ('<FromLaneCoordinates pathS="40" laneId="-1"/>', 298.25),
        ('<FromLaneCoordinates pathS="40" laneId="1" laneOffset="0.5"/>', 302.25),
        ('<FromRoadCoordinates pathS="40" t="-1"/>', 299.0),
    ],
)
def test_a_place_on_a_route_counts_along_the_route(where: str, x: float, tmp_path: Path) -> None:
    """The route leads south along road 8, whose own direction is north."""
    made = crossing(ON_ROUTE.format(SOUTH, where), speed_action("5")).load(tmp_path)
    assert pose(made, 0.0)[:2] == pytest.approx((x, 50.0), abs=1e-3)
    assert cos(pose(made, 0.0)[2] + pi / 2) == pytest.approx(1.0)
    assert pose(made, 4.0)[:2] == pytest.approx((x, 30.0), abs=1e-3)


@pytest.mark.parametrize(
    ("position", "says"),
    [
        (ON_ROUTE.format("", '<FromLaneCoordinates pathS="4" laneId="1"/>'), "RoutePosition needs a Route"),
        (ON_ROUTE.format(SOUTH, '<FromLaneCoordinates pathS="999" laneId="1"/>'), "pathS=999 lies beyond the route"),
        (ON_ROUTE.format(SOUTH, '<FromLaneCoordinates pathS="4" laneId="7"/>'), "no driving lane"),
        (ON_ROUTE.format(SOUTH, '<FromCurrentEntity entityRef="Ego"/>'), "FromCurrentEntity is not supported"),
        (ON_ROUTE.format("<Route/>", '<FromLaneCoordinates pathS="4" laneId="1"/>'), "a Route needs waypoints"),
        ('<TrajectoryPosition s="1"><TrajectoryRef/></TrajectoryPosition>', "TrajectoryPosition needs a Trajectory"),
    ],
)
def test_places_on_routes_that_are_refused(position: str, says: str, tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=says):
        crossing(position).load(tmp_path)


ARM = (
    '<road id="{}" length="80" junction="-1"><link><successor elementType="junction" elementId="5"/></link><planView>'
    '<geometry s="0" x="{}" y="{}" hdg="{}" length="80"><line/></geometry></planView><lanes><laneSection s="0">{}'
    "</laneSection></lanes></road>"
)
THROUGH = (
    '<road id="6" length="20" junction="5"><link><predecessor elementType="road" elementId="7" contactPoint="end"/>'
    "</link><planView>"
    '<geometry s="0" x="300" y="0" hdg="0" length="20"><line/></geometry></planView><lanes>'
    '<laneSection s="0">{}</laneSection></lanes></road>'
)
TO_JUNCTION = '<link><successor elementType="junction" elementId="5"/></link>'


@pytest.mark.parametrize(("north_x", "count"), [(310.0, 1), (330.0, 0), (None, 0)])
def test_roads_straight_across_a_junction_are_drawn(north_x: float | None, count: int, tmp_path: Path) -> None:
    """Not those of which only one arm exists, or whose arms do not meet."""
    both = f"<left>{lane(1)}</left><right>{lane(-1)}</right>"
    arms = ARM.format(8, 310, -90, pi / 2, both) + THROUGH.format(both)
    if north_x is not None:
        arms += ARM.format(9, north_x, 90, -pi / 2, both)
    parts = Parts(entities=entity("Ego"), init=init("Ego", on_lane(-1, 100.0), "10"))
    line = '<geometry s="0" x="0" y="0" hdg="0" length="300"><line/></geometry>'
    parts.road = xodr(line, inside=TO_JUNCTION, more=arms)
    crossings = parts.load(tmp_path).road.crossings
    assert len(crossings) == count
    if crossings:
        assert (crossings[0].s_m, crossings[0].angle_deg) == pytest.approx((310.0, 90.0), abs=0.01)
        assert (crossings[0].lanes_each_way, crossings[0].lane_width_m) == (1, 3.5)


CONNECTING = (
    '<road id="{}" length="{}" junction="5"><link><predecessor elementType="road" elementId="7" contactPoint="end"/>'
    '<successor elementType="road" elementId="{}" contactPoint="start"/></link><planView>'
    '<geometry s="0" x="300" y="0" hdg="0" length="{}"><arc curvature="{}"/></geometry></planView><lanes>'
    '<laneSection s="0">{}</laneSection></lanes></road>'
)
LEAVING = (
    '<road id="{}" length="200" junction="-1"><planView><geometry s="0" x="{}" y="{}" hdg="{}" length="200"><line/>'
    '</geometry></planView><lanes><laneSection s="0">{}</laneSection></lanes></road>'
)


def test_a_vehicle_ahead_turns_off_where_its_route_leads(tmp_path: Path) -> None:
    """The ego vehicle goes straight on at the junction; the lead turns right, through an arc of 20 m radius."""
    one = f"<right>{lane(-1)}</right>"
    route = (
        "<PrivateAction><RoutingAction><AssignRouteAction>"
        + ROUTE.format(on_lane(-1, 200.0), '<LanePosition roadId="13" laneId="-1" s="50"/>')
        + "</AssignRouteAction></RoutingAction></PrivateAction>"
    )
    parts = Parts(entities=entity("Ego") + entity("Lead", vehicle(centre=0.0)), stop=condition(at_time(20.0)))
    parts.init = init("Ego", on_lane(-1, 100.0), "10") + init("Lead", on_lane(-1, 200.0), "10", route)
    parts.road = xodr(
        '<geometry s="0" x="0" y="0" hdg="0" length="300"><line/></geometry>',
        lanes=one,
        inside=TO_JUNCTION,
        more=CONNECTING.format(6, 20, 12, 20, 0, one)
        + CONNECTING.format(10, 10 * pi, 13, 10 * pi, -0.05, one)
        + LEAVING.format(12, 320, 0, 0, one)
        + LEAVING.format(13, 320, -20, -pi / 2, one),
    )
    made = parts.load(tmp_path)
    assert made.actors == ()
    assert pose(made, 5.0) == pytest.approx((250.0, -1.75, 0.0), abs=0.01)
    turned_m = 18.25 * pi / 2
    assert pose(made, 10.0 + (turned_m + 5.0) / 10) == pytest.approx((318.25, -25.0, -pi / 2), abs=0.05)
    assert world_state.at(made, 20.0).pose == pytest.approx((303.5, -1.75, 0.0), abs=0.01)
