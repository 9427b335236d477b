"""Files with a pedestrian, and trajectories."""

from __future__ import annotations

from pipeline.simulation.scenario import Scenario
from tests.pipeline.simulation.openscenario.files import Parts, at_time, condition, entity, init, on_lane

PEDESTRIAN = (
    '<Pedestrian name="p" pedestrianCategory="pedestrian"><BoundingBox><Center x="0" y="0" z="0.9"/>'
    '<Dimensions length="0.6" width="0.5" height="1.8"/></BoundingBox></Pedestrian>'
)
ACROSS = '<LanePosition roadId="7" laneId="-1" s="160" offset="{}"/>'
VERTEX = "<Vertex {}><Position>{}</Position></Vertex>"
FOLLOW = (
    "<PrivateAction><RoutingAction><FollowTrajectoryAction {}><TimeReference>{}</TimeReference>"
    '<TrajectoryFollowingMode followingMode="position"/><TrajectoryRef>{}</TrajectoryRef></FollowTrajectoryAction>'
    "</RoutingAction></PrivateAction>"
)
TIMING = '<Timing domainAbsoluteRelative="relative" scale="1" offset="0"/>'


def trajectory(shape: str) -> str:
    return f'<Trajectory name="t" closed="false"><Shape>{shape}</Shape></Trajectory>'


def polyline(*vertices: str, times: tuple[float, ...] = ()) -> str:
    timed = [f'time="{t}"' for t in times] or [""] * len(vertices)
    inside = "".join(VERTEX.format(t, where) for t, where in zip(timed, vertices, strict=True))
    return trajectory(f"<Polyline>{inside}</Polyline>")


def follow(shape: str, timing: str = "<None/>", more: str = "") -> str:
    return FOLLOW.format(more, timing, shape)


def private(name: str, *actions: str) -> str:
    return f'<Private entityRef="{name}">{"".join(actions)}</Private>'


CROSS = polyline(ACROSS.format(-5), ACROSS.format(5))


def with_walker(*actions: str, stories: str = "", stop: str = condition(at_time(10.0))) -> Parts:
    """The ego vehicle, and a pedestrian with these actions in the Init."""
    return Parts(
        entities=entity("Ego") + entity("Walker", PEDESTRIAN),
        init=init("Ego", on_lane(-1, 100.0), "10") + private("Walker", *actions),
        stories=stories,
        stop=stop,
    )


def pose(made: Scenario, t_s: float) -> tuple[float, float, float]:
    """World x, y and heading of the only free actor; the road of these files is straight along x."""
    (actor,), (way,) = made.free_actors, made.free_ways
    x, y, heading = way.to_world(actor.travelled_m(t_s), 0.0)[0].tolist()
    return x, y, heading
