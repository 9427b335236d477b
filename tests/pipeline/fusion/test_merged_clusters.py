"""A near vehicle whose cluster has merged with a hedge: the points inside its box range it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from pipeline.common.geometry import Cuboid
from pipeline.fusion.merged_clusters import SIGMA_M, range_boxes
from pipeline.params import FusionParams
from pipeline.types import F32, I32, Detection, Ground, Obstacle, Point3, VisionMeasurement
from tests.pipeline.fusion.test_returns import ROAD, aligned

HEDGE, OTHER, GROUND = 3, 4, -1
CAR_M, HEDGE_M = 8.0, 11.0
BOX = (750.0, 150.0, 1270.0, 618.0)
"""Box of a car 8 m ahead, cut by the lower edge of the image."""


@dataclass(frozen=True)
class Scene:
    """A car in front of a hedge. The sweep has a face of the car and one of the hedge behind it."""

    length_m: float = 15.0
    """Of the cluster of both."""
    car_points: int = 60
    face_m: tuple[float, float] = (-0.8, 0.8)
    """Where the car's points begin and end, to the left."""
    cluster: int = HEDGE
    """To which the car's points belong."""
    ground: Ground | None = field(default_factory=lambda: ROAD)
    origin: Point3 = (0.0, 0.0, 0.0)

    @property
    def points(self) -> F32:
        face, hedge = np.linspace(*self.face_m, self.car_points), np.linspace(-6.0, 6.0, 200)
        heights = np.tile([-0.4, 0.0, 0.3], 100)
        rows = [(CAR_M, y, z, 0.0) for y, z in zip(face, heights, strict=False)]
        rows += [(HEDGE_M, y, z, 0.0) for y, z in zip(hedge, heights, strict=False)]
        rows += [(5.0 + n / 50, 0.0, -0.8, 0.0) for n in range(100)]
        return np.array(rows, np.float32)

    @property
    def kind(self) -> I32:
        return np.repeat([self.cluster, HEDGE, GROUND], [self.car_points, 200, 100]).astype(np.int32)

    @property
    def ring(self) -> np.ndarray:
        return np.zeros(len(self.points), np.uint8)

    @property
    def obstacles(self) -> tuple[Obstacle, ...]:
        def obstacle(cluster: int, length_m: float) -> Obstacle:
            return Obstacle(
                cluster, Cuboid((10.0, 0.0, 0.0), (length_m, 3.0, 2.0), 0.0), (8.0, 0.0, 0.0), 260, 9.0, (1.0, 1.0, 1.0)
            )

        return obstacle(HEDGE, self.length_m), obstacle(OTHER, 4.0)


def box(label: str = "car", distance_m: float | None = None) -> VisionMeasurement:
    if distance_m is None:
        return VisionMeasurement(Detection(BOX, label, 0.8), None, None, None)
    return VisionMeasurement(Detection(BOX, label, 0.8), distance_m, 0.1 * distance_m, (distance_m, 0.0))


def ranged(seen: VisionMeasurement, scene: Scene, params: FusionParams | None = None) -> VisionMeasurement:
    found = range_boxes((seen,), scene, aligned(), params or FusionParams())
    assert found is not None
    return found[0]


def test_a_car_whose_box_is_cut_is_placed_by_its_points() -> None:
    found = ranged(box(), Scene())
    assert found.distance_m == found.ranged_m == pytest.approx(CAR_M, abs=0.1)
    assert (found.sigma_m, found.returns > 40) == (SIGMA_M, True)
    assert found.position == pytest.approx((CAR_M, 0.0), abs=0.2)


def test_a_distance_by_the_camera_is_made_exact() -> None:
    found = ranged(box(distance_m=9.0), Scene())
    assert (found.ranged_m, found.ranged_sigma_m) == (pytest.approx(CAR_M, abs=0.1), SIGMA_M)
    assert found.distance_m == 9.0, "what the camera said is kept beside it"


@pytest.mark.parametrize(
    ("seen", "scene"),
    [
        pytest.param(box(), Scene(length_m=4.5), id="a cluster of its own is left to fusion"),
        pytest.param(box("bus"), Scene(), id="a bus may be that long"),
        pytest.param(box(), Scene(cluster=OTHER, car_points=250, length_m=4.5), id="another vehicle's cluster"),
        pytest.param(box(distance_m=20.0), Scene(), id="the camera says that it is elsewhere"),
        pytest.param(box(distance_m=9.8), Scene(), id="the camera says that it is the next car of a row"),
        pytest.param(box(), Scene(face_m=(0.4, 0.8)), id="the flank of a nearer car"),
        pytest.param(box("person"), Scene(), id="no vehicle"),
        pytest.param(box(distance_m=35.0), Scene(), id="far: single returns range it"),
        pytest.param(box(), replace(Scene(), ground=None), id="the road is not known"),
    ],
)
def test_what_stays_as_it_is(seen: VisionMeasurement, scene: Scene) -> None:
    assert ranged(seen, scene) == seen


@dataclass(frozen=True)
class Alongside(Scene):
    """A van parked beside the path, of whose flank the box shows the part from 3 to 7 m ahead."""

    @property
    def points(self) -> F32:
        points = super().points
        points[: self.car_points, 0] = np.linspace(3.0, 7.0, self.car_points)
        points[: self.car_points, 1] = -2.05
        return points


@pytest.mark.parametrize("distance_m", [3.8, None])
def test_a_vehicle_beside_the_path_is_where_its_nearest_points_are(distance_m: float | None) -> None:
    scene, alignment = Alongside(), aligned()
    u, v = alignment.project(scene.points[: scene.car_points, :3].astype(np.float64)).T
    bbox = (u.min() - 40.0, v.min() - 300.0, u.max() + 60.0, v.max() + 40.0)
    _, rays = alignment.rays(np.array([[(bbox[0] + bbox[2]) / 2, 360.0]]))
    middle = rays[0][:2] / np.hypot(*rays[0][:2])
    place = None if distance_m is None else (distance_m * middle[0], distance_m * middle[1])
    seen = VisionMeasurement(Detection(bbox, "car", 0.8), distance_m, distance_m and 0.1 * distance_m, place)
    found = ranged(seen, scene)
    assert found.ranged_m == pytest.approx(np.hypot(3.3, 2.05), abs=0.3)
    assert found.position is not None
    assert -2.05 < found.position[1] < -1.7
    assert middle[1] * found.ranged_m > -1.7, "the middle of the box would be in the path"


@dataclass(frozen=True)
class Fence(Scene):
    """A fence that runs past the car, between it and the sensor."""

    half_m: float = 8.0
    """Half of its length."""

    @property
    def points(self) -> F32:
        points = super().points
        along = np.linspace(-self.half_m, self.half_m, self.car_points)
        points[: self.car_points, 0], points[: self.car_points, 1] = CAR_M + 0.2 * along, along
        return points


def test_a_fence_that_goes_on_beside_the_box_is_no_face() -> None:
    seen = VisionMeasurement(Detection((850.0, 150.0, 1170.0, 618.0), "car", 0.8), 9.0, 0.9, (9.0, 0.0))
    assert ranged(seen, Fence()) == seen
    ends_with_it = ranged(seen, Fence(half_m=0.8))
    assert ends_with_it.ranged_m == pytest.approx(CAR_M, abs=0.3)


def test_a_few_points_before_the_hedge_are_no_face() -> None:
    assert ranged(box(), Scene(car_points=10)).ranged_m == pytest.approx(HEDGE_M, abs=0.2)


def test_it_can_be_switched_off() -> None:
    assert ranged(box(), Scene(), FusionParams(merged_clusters=False)) == box()
    assert range_boxes(None, Scene(), aligned(), FusionParams()) is None
    assert range_boxes((box(),), Scene(), None, FusionParams()) == (box(),)
