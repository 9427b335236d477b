"""Trajectories of every shape, from catalogs, in the Init and during the drive, and that of the ego vehicle."""

from __future__ import annotations

from math import cos, pi, sin
from pathlib import Path

import numpy as np
import pytest

from pipeline.simulation.scenario import ScenarioError
from pipeline.simulation.world import world_state
from tests.pipeline.simulation.openscenario.files import (
    Parts,
    at_time,
    condition,
    declared,
    entity,
    event,
    init,
    lane_action,
    on_lane,
    speed_action,
    story,
    vehicle,
    xodr,
)
from tests.pipeline.simulation.openscenario.walkers import (
    ACROSS,
    CROSS,
    follow,
    polyline,
    pose,
    private,
    trajectory,
    with_walker,
)

ENTRY = (
    '<Trajectory name="cross" closed="false"><ParameterDeclarations>'
    '<ParameterDeclaration name="at" parameterType="double" value="1"/></ParameterDeclarations><Shape><Polyline>'
    '<Vertex><Position><LanePosition roadId="7" laneId="-1" s="$at" offset="-5"/></Position></Vertex>'
    '<Vertex><Position><LanePosition roadId="7" laneId="-1" s="$at" offset="${$at/40}"/></Position></Vertex>'
    "</Polyline></Shape></Trajectory>"
)
CATALOG = f'<OpenSCENARIO><FileHeader revMajor="1" revMinor="2"/><Catalog name="ways">{ENTRY}</Catalog></OpenSCENARIO>'


def test_trajectories_come_from_catalogs_with_parameters(tmp_path: Path) -> None:
    (tmp_path / "ways").mkdir()
    (tmp_path / "ways" / "ways.xosc").write_text(CATALOG, encoding="utf-8")
    reference = (
        '<CatalogReference catalogName="ways" entryName="cross"><ParameterAssignments>'
        '<ParameterAssignment parameterRef="at" value="${$place+10}"/></ParameterAssignments></CatalogReference>'
    )
    parts = with_walker(follow(reference), speed_action("1"))
    parts.parameters = declared("place", "150")
    parts.catalogs = '<TrajectoryCatalog><Directory path="ways"/></TrajectoryCatalog>'
    made = parts.load(tmp_path)
    assert [pose(made, t_s) for t_s in (0.0, 9.0)] == [
        pytest.approx(place) for place in ((160.0, -6.75, pi / 2), (160.0, 2.25, pi / 2))
    ]


CLOTHOID = '<Clothoid curvature="0" {}="0.002" length="40" {}><Position>{}</Position></Clothoid>'
SPLINE = "<ClothoidSpline>{}</ClothoidSpline>"
SEGMENT = '<ClothoidSplineSegment curvatureStart="{}" curvatureEnd="{}" length="{}">{}</ClothoidSplineSegment>'
START = f"<PositionStart>{on_lane(-2, 160.0)}</PositionStart>"
ARC = trajectory(SPLINE.format(SEGMENT.format(0, 0, 10, START) + SEGMENT.format(0.05, 0.05, 10 * pi, "")))
POINTS = "".join(
    f'<ControlPoint><Position><WorldPosition x="{160 + x}" y="{y}"/></Position></ControlPoint>'
    for x, y in ((0, -5.25), (10, -5.25), (20, 4.75))
)
KNOTS = "".join(f'<Knot value="{value}"/>' for value in (0, 0, 0, 1, 1, 1))
NURBS = trajectory(f'<Nurbs order="3">{POINTS}{KNOTS}</Nurbs>')


@pytest.mark.parametrize(
    ("shape", "after_s", "expected"),
    [
        pytest.param(
            trajectory(CLOTHOID.format("curvatureDot", "", on_lane(-2, 160.0))), 4.0, (None, None, 1.6), id="1.0"
        ),
        pytest.param(
            trajectory(CLOTHOID.format("curvaturePrime", "", on_lane(-2, 160.0))), 4.0, (None, None, 1.6), id="1.1"
        ),
        pytest.param(ARC, 1.0 + pi, (190.0, 14.75, pi / 2), id="spline of clothoids"),
        pytest.param(NURBS, 2.4, (None, None, pi / 4), id="NURBS"),
    ],
)
def test_every_shape_of_a_trajectory(
    shape: str, after_s: float, expected: tuple[float | None, float | None, float], tmp_path: Path
) -> None:
    """A car at 10 m/s; centre and reference point coincide."""
    parts = Parts(
        entities=entity("Ego") + entity("Car", vehicle(centre=0.0)),
        init=init("Ego", on_lane(-1, 100.0), "10") + private("Car", follow(shape), speed_action("10")),
    )
    made = parts.load(tmp_path)
    assert pose(made, 0.0) == pytest.approx((160.0, -5.25, 0.0), abs=1e-6)
    for found, wanted in zip(pose(made, after_s), expected, strict=True):
        assert wanted is None or found == pytest.approx(wanted, abs=0.03)


def test_a_trajectory_that_begins_where_the_vehicle_is_is_followed_during_the_drive(tmp_path: Path) -> None:
    """The car drives 20 m, then follows an arc of 20 m radius to its left. What was driven stays."""
    bend = trajectory(SPLINE.format(SEGMENT.format(0.05, 0.05, 10 * pi, "")))
    parts = Parts(
        entities=entity("Ego") + entity("Lead", vehicle(centre=0.0)),
        init=init("Ego", on_lane(-1, 100.0), "10") + init("Lead", on_lane(-1, 150.0), "10"),
        stories=story(event("e", follow(bend), condition(at_time(2.0)))),
    )
    made = parts.load(tmp_path)
    assert pose(made, 1.0) == pytest.approx((160.0, -1.75, 0.0), abs=1e-3)
    assert pose(made, 4.0) == pytest.approx((170.0 + 20 * sin(1.0), -1.75 + 20 * (1 - cos(1.0)), 1.0), abs=0.02)


@pytest.mark.parametrize(
    ("shape", "says"),
    [
        (polyline(ACROSS.format(5), ACROSS.format(8)), r"the trajectory of Lead begins \d+.\d m away from it"),
        (polyline(on_lane(-1, 170.0), on_lane(-1, 100.0)), "leads behind it, and driving backwards is not supported"),
        (trajectory(SPLINE.format("")), "a ClothoidSpline needs 1 to 2000 segments"),
        (trajectory(SPLINE.format(SEGMENT.format(0, 0, -1, ""))), "length=-1: expected a positive number"),
        (
            trajectory(SPLINE.format(SEGMENT.format(0, 0, 9, "") + SEGMENT.format(0, 0, 9, START))),
            "does not begin where",
        ),
        (trajectory(SPLINE.format(SEGMENT.format(0, 0, 9, "").replace("length", 'hOffset="1" length'))), "has a kink"),
        (trajectory('<Nurbs order="3"><ControlPoint/></Nurbs>'), "needs 2 to 2000 points"),
        (
            trajectory(f'<Nurbs order="3">{POINTS}</Nurbs>'),
            "this trajectory is not supported: 3 control points and order 3",
        ),
        (trajectory("<Circle/>"), "a trajectory of Circle is not supported; Polyline, Clothoid"),
    ],
)
def test_trajectories_that_are_refused(shape: str, says: str, tmp_path: Path) -> None:
    parts = Parts(stories=story(event("e", follow(shape), condition(at_time(1.0)))))
    with pytest.raises(ScenarioError, match=says) as error:
        parts.load(tmp_path)
    assert "\n" not in str(error.value)


def test_a_vehicle_on_a_line_has_no_lane_to_change(tmp_path: Path) -> None:
    change = lane_action('<AbsoluteTargetLane value="-2"/>')
    with pytest.raises(ScenarioError, match="LaneChangeAction of Walker is not supported: it follows no lane there"):
        with_walker(follow(CROSS), stories=story(event("e", change), actors="Walker")).load(tmp_path)


# ---------------------------------------------------------------- the ego vehicle's own trajectory

TELEPORT = "<PrivateAction><TeleportAction><Position>{}</Position></TeleportAction></PrivateAction>"
TURN = trajectory(
    SPLINE.format(
        SEGMENT.format(0, 0, 50, f"<PositionStart>{on_lane(-1, 200.0)}</PositionStart>")
        + SEGMENT.format(0.1, 0.1, 5 * pi, "")
        + SEGMENT.format(0, 0, 60, "")
    )
)


def test_the_way_of_an_ego_vehicle_that_turns_is_its_trajectory(tmp_path: Path) -> None:
    """50 m straight on, then a quarter of a circle of 10 m radius to the left. Its nose is 3.5 m ahead."""
    parts = Parts(
        init=private("Ego", follow(TURN), speed_action("10")) + init("Lead", on_lane(-1, 230.0), "0"),
    )
    made = parts.load(tmp_path)
    poses = [np.array(world_state.at(made, t_s).pose) for t_s in (0.0, 4.65 + pi / 2, 9.0)]
    assert poses[0] == pytest.approx((203.5, -1.75, 0.0), abs=0.02)
    assert poses[1] == pytest.approx((260.0, 8.25, pi / 2), abs=0.04)
    assert poses[2][0] == pytest.approx(260.0, abs=0.03)
    parts.stop = condition(at_time(60.0))
    assert "The drive ends where the ego vehicle has followed its trajectory." in parts.load(tmp_path).notes
    assert made.actors[0].ahead_m == pytest.approx(230.0 + 1.5 - 2.0 - 203.5, abs=0.01)


def test_an_ego_trajectory_along_lanes_keeps_the_roads_of_the_file(tmp_path: Path) -> None:
    along = polyline(on_lane(-1, 100.0), on_lane(-1, 400.0))
    parts = Parts(init=private("Ego", follow(along, more='initialDistanceOffset="20"'), speed_action("10")))
    parts.entities = entity("Ego")
    parts.road = xodr('<geometry s="0" x="0" y="0" hdg="0.1" length="2000"><line/></geometry>')
    made = parts.load(tmp_path)
    assert made.ego.start_m == pytest.approx(120.0 + 3.5)
    assert [segment.length_m for segment in made.road.segments] == [2000.0]


@pytest.mark.parametrize(
    ("start", "says"),
    [
        (
            private("Ego", follow(polyline(on_lane(-1, 100.0), on_lane(-1, 50.0))), speed_action("5"))
            + private(
                "Ego",
                TELEPORT.format(on_lane(-1, 100.0)),
            ),
            "the trajectory of Ego leads behind it, and driving backwards is not supported",
        ),
        (
            private(
                "Ego", follow(polyline('<RelativeRoadPosition entityRef="Lead" ds="1" dt="0"/>', on_lane(-1, 400.0)))
            ),
            "the start of the ego vehicle cannot refer to Lead",
        ),
        (private("Ego", follow(trajectory(SPLINE.format(SEGMENT.format(0, 0, 9, ""))))), "has no start position"),
        (private("Ego", speed_action("5")), "the ego vehicle Ego has no position in Init, or no trajectory there"),
    ],
)
def test_starts_of_the_ego_vehicle_that_are_refused(start: str, says: str, tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=says):
        Parts(init=start + init("Lead", on_lane(-1, 150.0), "20")).load(tmp_path)


def test_an_ego_trajectory_during_the_drive_is_refused(tmp_path: Path) -> None:
    turn = trajectory(SPLINE.format(SEGMENT.format(0.1, 0.1, 9, "")))
    with pytest.raises(ScenarioError, match="a trajectory of the ego vehicle that leaves its lane is supported at the"):
        Parts(stories=story(event("e", follow(turn), condition(at_time(1.0))), actors="Ego")).load(tmp_path)
