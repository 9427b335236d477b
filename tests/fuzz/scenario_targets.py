"""OpenSCENARIO files, their roads and their parameter values."""

from __future__ import annotations

from pathlib import Path

from pipeline.simulation import scenario
from tests.fuzz.file_targets import by_file
from tests.fuzz.target import Target
from tests.pipeline.simulation.openscenario.files import (
    BEND,
    LEFT,
    RIGHT,
    STRAIGHT,
    Parts,
    at_time,
    condition,
    declared,
    entity,
    event,
    init,
    lane,
    lane_action,
    on_lane,
    speed_action,
    story,
    vehicle,
    xodr,
)
from tests.pipeline.simulation.openscenario.walkers import CROSS, follow, private, trajectory

_LONGITUDINAL = "<PrivateAction><LongitudinalAction>{}</LongitudinalAction></PrivateAction>"
_VERTEX = '<Vertex time="{}"><Position><RelativeRoadPosition entityRef="Lead" ds="{}" dt="{}"/></Position></Vertex>'
_EVENTS = (
    event("keep", speed_action('<RelativeTargetSpeed entityRef="Ego" value="1" continuous="true"/>')),
    event(
        "gap",
        _LONGITUDINAL.format(
            '<LongitudinalDistanceAction entityRef="Ego" freespace="true" continuous="true" timeGap="1.5">'
            '<DynamicConstraints maxAcceleration="2" maxDeceleration="4" maxAccelerationRate="1" maxSpeed="40"/>'
            "</LongitudinalDistanceAction>"
        ),
        condition(at_time(1.0)),
    ),
    event(
        "profile",
        _LONGITUDINAL.format(
            '<SpeedProfileAction followingMode="follow"><DynamicConstraints maxAcceleration="2" maxDeceleration="4" '
            'maxAccelerationRate="1" maxDecelerationRate="2"/><SpeedProfileEntry time="2" speed="22"/>'
            '<SpeedProfileEntry speed="18"/></SpeedProfileAction>'
        ),
        condition(at_time(2.0)),
    ),
    event(
        "meet",
        f'<PrivateAction><SynchronizeAction masterEntityRef="Ego"><TargetPositionMaster>{on_lane(-1, 300.0)}'
        f"</TargetPositionMaster><TargetPosition>{on_lane(-1, 350.0)}</TargetPosition><FinalSpeed>"
        '<AbsoluteSpeed value="15"><TargetTimeSteadyState time="1"/></AbsoluteSpeed></FinalSpeed></SynchronizeAction>'
        "</PrivateAction>",
        condition(at_time(3.0)),
    ),
    event(
        "follow",
        "<PrivateAction><RoutingAction><FollowTrajectoryAction><TrajectoryRef><Trajectory><Shape><Polyline>"
        f"{_VERTEX.format(0, 0, 0)}{_VERTEX.format(3, 50, -3)}"
        "</Polyline></Shape></Trajectory></TrajectoryRef><TimeReference>"
        '<Timing domainAbsoluteRelative="relative" scale="1" offset="0"/></TimeReference></FollowTrajectoryAction>'
        "</RoutingAction></PrivateAction>",
        condition(at_time(5.0)),
    ),
)
"""Every kind of action that takes time, one after another."""

_BEND_LEFT = trajectory(
    f'<ClothoidSpline><ClothoidSplineSegment curvatureStart="0" curvatureEnd="0.05" length="30"><PositionStart>'
    f'{on_lane(-1, 100.0)}</PositionStart></ClothoidSplineSegment><ClothoidSplineSegment curvatureStart="0.05" '
    'curvatureEnd="0" length="30"/></ClothoidSpline>'
)
_CONTROL = (
    '<ControlPoint weight="1"><Position><RelativeWorldPosition entityRef="Lead" dx="{}" dy="{}"/></Position>'
    "</ControlPoint>"
)
_NURBS = trajectory(
    f'<Nurbs order="3">{_CONTROL.format(0, 0)}{_CONTROL.format(10, 0)}{_CONTROL.format(20, 10)}'
    + "".join(f'<Knot value="{value}"/>' for value in (0, 0, 0, 1, 1, 1))
    + "</Nurbs>"
)
_WAYPOINT = "<Waypoint routeStrategy='shortest'><Position>{}</Position></Waypoint>"
_ON_ROUTE = (
    f"<RoutePosition><RouteRef><Route name='r'>{_WAYPOINT.format(on_lane(-2, 90.0))}"
    f"{_WAYPOINT.format(on_lane(-2, 400.0))}</Route></RouteRef><InRoutePosition>"
    '<FromLaneCoordinates pathS="50" laneId="-2" laneOffset="0.5"/></InRoutePosition></RoutePosition>'
)
"""Trajectories and routes of every kind."""

_OPENING = '<lane id="-3" type="driving"><width sOffset="0" a="0" b="0" c="0.0036" d="-0.000048"/></lane>'
_CURVES = xodr(
    '<geometry s="0" x="0" y="0" hdg="0.1" length="200"><line/></geometry>'
    '<geometry s="200" x="199.0008" y="19.9667" hdg="0.1" length="150.45"><paramPoly3 pRange="normalized" aU="0" '
    'bU="150" cU="0" dU="0" aV="0" bV="0" cV="10" dV="-2"/></geometry>',
    f'{LEFT}{RIGHT}</laneSection><laneSection s="220">{LEFT}<right>{lane(-1)}{lane(-2)}{_OPENING}</right>',
    '<elevationProfile><elevation s="0" a="0" b="0.02" c="-0.0001" d="0"/></elevationProfile>'
    '<lateralProfile><superelevation s="0" a="0.03" b="0" c="0" d="0"/></lateralProfile>',
)
"""Polynomials, lane sections and profiles."""

_JOINED = xodr(
    STRAIGHT.replace("2000", "290"),
    inside='<link><successor elementType="junction" elementId="9"/></link>',
    more=(
        '<road id="11" junction="9" length="60"><link>'
        '<predecessor elementType="road" elementId="7" contactPoint="end"/>'
        '<successor elementType="road" elementId="8" contactPoint="end"/></link><planView>'
        '<geometry s="0" x="290" y="0" hdg="0" length="60"><arc curvature="0.01"/></geometry></planView>'
        f"<lanes><laneSection s='0'><right>{lane(-1)}</right></laneSection></lanes></road>"
        '<road id="8" length="80"><planView><geometry s="0" x="400" y="0" hdg="3" length="80">'
        '<poly3 a="0" b="0" c="0.001" d="0"/></geometry></planView>'
        f"<lanes><laneSection s='0'>{LEFT}</laneSection></lanes></road>"
        '<junction id="9"/>'
    ),
)
"""Roads that join through a junction."""


def scenario_targets(folder: Path) -> dict[str, Target]:
    """All targets of this module. Their files are written below ``folder``, which is created."""
    folder.mkdir()
    whole = Parts(
        parameters=declared("v", "20") + declared("w", "${$v/2+min(1, 2)}"),
        stories=story(
            event("brake", speed_action("$w", "linear", 3.0), condition(at_time(1.0))),
            event("turn", lane_action('<AbsoluteTargetLane value="-2"/>'), condition(at_time(2.0), 1.0, "rising")),
        ),
    )
    path = whole.write(folder)
    acting = Parts(init=whole.init, stories=story(*_EVENTS))
    values = (
        '<OpenSCENARIO><ParameterValueDistribution><ScenarioFile filepath="drive.xosc"/><Deterministic>'
        '<DeterministicSingleParameterDistribution parameterName="v"><DistributionRange stepWidth="5">'
        '<Range lowerLimit="20" upperLimit="20"/></DistributionRange></DeterministicSingleParameterDistribution>'
        "</Deterministic></ParameterValueDistribution></OpenSCENARIO>"
    )
    kept = folder / "kept"
    kept.mkdir()
    beside = whole.write(kept)
    crossing = Parts(
        entities=entity("Ego") + entity("Walker", vehicle("bicycle")) + entity("Lead"),
        init=private("Ego", follow(_BEND_LEFT), speed_action("8"))
        + private("Walker", follow(CROSS, more='initialDistanceOffset="1"'), speed_action("1"))
        + init("Lead", _ON_ROUTE, "5"),
        stories=story(event("round", follow(_NURBS), condition(at_time(1.0)))),
    )
    return {
        "openscenario": Target(
            (path.read_bytes(), acting.xosc().encode(), crossing.xosc().encode()),
            by_file(folder, path.name, scenario.load),
        ),
        "opendrive": Target(
            tuple(text.encode() for text in (whole.road, BEND, _CURVES, _JOINED)),
            by_file(kept, "road.xodr", lambda _: scenario.load(str(beside))),
        ),
        "parameter values": Target((values.encode(),), by_file(kept, "values.xosc", scenario.load)),
    }
