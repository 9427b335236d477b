"""Evidence for and against an object, and what a sensor cannot observe."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from pipeline.fusion.existence import Existence, ExistenceState, weigh
from pipeline.fusion.last_place import last_place
from pipeline.params import CipvParams, ExistenceParams
from pipeline.types import (
    F32,
    I32,
    U8,
    CameraImage,
    EgoState,
    Frame,
    FusedObject,
    Ground,
    Point3,
    RawBoxes,
)
from tests.pipeline.build import fused, moment

PARAMS = ExistenceParams()
FRAME = Frame(0, "0", 0)
ROAD_M = -0.6
ROAD = Ground(np.zeros(0, bool), np.array([[0.0, 0.0, 1.0, -ROAD_M]]), np.array([0.0, 100.0]), np.ones(1, bool))


@dataclass(frozen=True)
class Rays:
    """The parts of a sweep that matter for rays."""

    points: F32
    ground: Ground | None = ROAD
    origin: Point3 = (0.0, 0.0, 0.0)
    cluster: int = -2
    """Cluster of every point; negative: none."""

    @property
    def kind(self) -> I32:
        return np.full(len(self.points), self.cluster, np.int32)

    @property
    def ring(self) -> U8:
        """Rays in which each height is a ring."""
        return np.unique(self.points[:, 2], return_inverse=True)[1].astype(np.uint8)


def returns(range_m: float, bearing_deg: float = 0.0, height_m: float = 0.6) -> F32:
    """Eleven rays in a fan of 2°, each ending at this range and height above the road."""
    turn = np.radians(bearing_deg + np.linspace(-1.0, 1.0, 11))
    z = np.full(11, ROAD_M + height_m)
    return np.stack([range_m * np.cos(turn), range_m * np.sin(turn), z, np.zeros(11)], axis=1).astype(np.float32)


NOTHING: F32 = np.zeros((0, 4), np.float32)


def camera_car(range_m: float = 12.0, sigma_m: float = 1.2, score: float = 0.8) -> FusedObject:
    return replace(fused(1, range_m, source="V"), distance_sigma_m=sigma_m, score=score)


def after(item: FusedObject, rays: Rays, frames: int = 5, params: ExistenceParams = PARAMS) -> FusedObject:
    state = ExistenceState()
    for k in range(frames):
        state, (found,) = weigh(state, (item,), rays, FRAME, moment(None, 0.1 if k else None), params)
    return found


def gate(item: FusedObject) -> bool | None:
    """Whether the ``free_road`` gate passed; None without the gate."""
    return next((each.passed for each in item.gates if each.name == "free_road"), None)


@pytest.mark.parametrize(
    ("points", "exists", "said"),
    [
        pytest.param(NOTHING, True, None, id="no ray came that way: cannot know"),
        pytest.param(returns(40.0), False, False, id="rays at body height are returned by something far behind"),
        pytest.param(returns(12.5), True, True, id="rays end where it is said to be"),
        pytest.param(returns(5.0), True, None, id="something nearer stops them: cannot know"),
        pytest.param(returns(40.0, bearing_deg=15.0), True, None, id="rays beside it"),
        pytest.param(returns(40.0, height_m=8.0), True, None, id="rays over its roof"),
        pytest.param(returns(40.0, height_m=-0.5), True, None, id="rays under it"),
    ],
)
def test_what_a_working_lidar_would_have_to_see(points: F32, exists: bool, said: bool | None) -> None:
    found = after(camera_car(), Rays(points))
    assert found.existence is not None
    assert (found.existence > 0.5, gate(found)) == (exists, said)


ASIDE = np.concatenate([returns(30.0, bearing_deg=side) for side in (-20.0, 20.0)])
"""A ring at body height without returns from straight ahead."""
TARMAC = returns(6.0, height_m=0.0)
"""Returns from the road in front of the position, which prove that the sensor sees in that direction."""


@pytest.mark.parametrize(
    ("points", "range_m", "exists", "said"),
    [
        pytest.param([ASIDE, TARMAC], 12.0, False, False, id="the ring looks there and nothing comes back"),
        pytest.param([ASIDE], 12.0, True, None, id="no ring has anything there: the window may be dirty"),
        pytest.param([TARMAC], 12.0, True, None, id="no ring is known to look there at body height"),
        pytest.param([ASIDE, TARMAC, returns(5.0)], 12.0, True, None, id="something nearer hides it"),
        pytest.param([ASIDE, TARMAC], 45.0, True, None, id="too far for a VLP-16"),
    ],
)
def test_silence_speaks_against_it(points: list[F32], range_m: float, exists: bool, said: bool | None) -> None:
    found = after(camera_car(range_m, sigma_m=1.2), Rays(np.concatenate(points)))
    assert found.existence is not None
    assert (found.existence > 0.5, gate(found)) == (exists, said)


@pytest.mark.parametrize(
    ("range_m", "exists"), [pytest.param(12.0, False, id="near"), pytest.param(30.0, True, id="too far to have one")]
)
def test_near_by_a_vehicle_has_a_cluster_of_its_own(range_m: float, exists: bool) -> None:
    """A second box beside a parked car: the rays there hit the parked car, which is another object."""
    found = after(camera_car(range_m), Rays(returns(range_m + 0.5), cluster=3))
    assert found.existence is not None
    assert (found.existence > 0.5) == exists
    said = [(each.value, each.limit, each.passed) for each in found.gates if each.name == "own_returns"]
    assert said == ([] if exists else [(0.0, 3, False)])


@pytest.mark.parametrize(
    ("seconds", "exists"), [pytest.param(1.0, True, id="was followed"), pytest.param(0.1, False, id="for one sweep")]
)
def test_a_lead_whose_cluster_was_joined_with_its_neighbours_is_still_there(seconds: float, exists: bool) -> None:
    """A van that the LiDAR tracked stops beside a parked car: their points form one cluster, that of the parked car. A
    box that was joined with a cluster only once is not such a van."""
    van, rays = camera_car(8.0), Rays(returns(8.5), cluster=3)
    ranged = replace(van, source="VL", seen_by="VL")
    state = ExistenceState({van.id: Existence(0.8, 0.0)})
    for _ in range(round(seconds / 0.1)):
        state, _ = weigh(state, (ranged,), rays, FRAME, moment(None, 0.1), PARAMS)
    for _ in range(10):
        state, (found,) = weigh(state, (van,), rays, FRAME, moment(None, 0.1), PARAMS)
    assert found.existence is not None
    assert (found.existence > 0.5) == exists


@pytest.mark.parametrize(
    ("number", "exists"), [pytest.param(7, False, id="its own"), pytest.param(9, True, id="another: may have merged")]
)
def test_a_box_whose_own_cluster_goes_on_without_it_is_misplaced(number: int, exists: bool) -> None:
    """A truck that overtakes: the image's edge cuts off most of it, so its box no longer matches its long flank."""
    truck, rays = camera_car(8.0), Rays(returns(8.5), cluster=3)
    ranged = replace(truck, source="VL", seen_by="VL", lidar_track=7)
    flank = replace(fused(2, 8.5, source="L"), lidar_track=number)
    state = ExistenceState({truck.id: Existence(0.8, 0.0)})
    for _ in range(10):
        state, _ = weigh(state, (ranged,), rays, FRAME, moment(None, 0.1), PARAMS)
    for _ in range(5):
        state, (found, _) = weigh(state, (truck, flank), rays, FRAME, moment(None, 0.1), PARAMS)
    assert found.existence is not None
    assert (found.existence > 0.5) == exists


@pytest.mark.parametrize(("number", "exists"), [(1, True), (2, False)], ids=["the object's", "a number of its own"])
def test_what_the_lidar_followed_under_another_number_has_not_merged(number: int, exists: bool) -> None:
    """An oncoming van, whose box jumps to a second one on it. The van keeps its number, and the box gets a new one."""
    van, rays = replace(camera_car(8.0), vision_track=7), Rays(returns(8.5), cluster=3)
    state = ExistenceState()
    for _ in range(10):
        state, _ = weigh(state, (replace(van, source="VL", seen_by="VL"),), rays, FRAME, moment(None, 0.1), PARAMS)
    for _ in range(10):
        state, (found,) = weigh(state, (replace(van, id=number),), rays, FRAME, moment(None, 0.1), PARAMS)
    assert found.existence is not None
    assert (found.existence > 0.5) == exists


def test_rays_start_at_the_sensor() -> None:
    """A ray from the roof passes over the position, although its return behind is at body height."""
    high = Rays(returns(40.0, height_m=0.6), origin=(0.0, 0.0, 3.0))
    assert gate(after(camera_car(), high)) is None
    assert gate(after(camera_car(), Rays(returns(40.0, height_m=0.6)))) is False


def test_a_vague_distance_needs_rays_through_all_of_it() -> None:
    """At 12 ± 1.2 m with a wall at 18 m, the car cannot exist. At 12 ± 4 m, it may be the wall."""
    wall = Rays(returns(18.0))
    assert gate(after(camera_car(sigma_m=1.2), wall)) is False
    assert gate(after(camera_car(sigma_m=4.0), wall)) is True


def test_what_stands_a_little_farther_away_than_its_box_says_may_be_the_car() -> None:
    """At 12 ± 1.2 m, the car cannot be at 18 m, but perhaps at 16.5 m. The road farther away is no car."""
    wall, road = after(camera_car(), Rays(returns(16.5))), after(camera_car(), Rays(returns(40.0, height_m=0.0)))
    assert (gate(wall), wall.existence) == (None, after(camera_car(), Rays(NOTHING)).existence)
    assert gate(road) is False


def test_missing_returns_say_nothing_of_a_car_that_may_be_too_far() -> None:
    missing = Rays(np.concatenate([ASIDE, TARMAC]))
    assert gate(after(camera_car(27.0, sigma_m=1.0), missing)) is False
    assert gate(after(camera_car(27.0, sigma_m=2.7), missing)) is None
    assert gate(after(camera_car(29.5, sigma_m=0.3), missing)) is False
    assert gate(after(camera_car(32.0, sigma_m=0.3), missing)) is None, "the LiDAR followed it out of its reach"


def test_rays_that_end_somewhere_in_a_vague_distance_do_not_speak_for_it() -> None:
    """A weak box at 40 ± 8 m and a hedge at 35 m."""
    weak = camera_car(40.0, sigma_m=8.0, score=0.35)
    assert after(weak, Rays(returns(35.0)), frames=20).existence == after(weak, Rays(NOTHING)).existence


def test_a_surer_box_is_likelier_there_and_repeating_it_does_not_help() -> None:
    nothing = Rays(NOTHING)
    by_score = [after(camera_car(score=score), nothing).existence for score in (0.3, 0.45, 0.6, 0.9)]
    assert by_score == sorted(by_score)  # type: ignore[type-var]
    assert by_score[1] == pytest.approx(0.5)
    assert (
        after(camera_car(score=0.35), nothing, frames=50).existence == after(camera_car(score=0.35), nothing).existence
    )


def test_a_cluster_speaks_for_it_whatever_the_box_says() -> None:
    both = replace(fused(1, 12.0, source="VL"), score=0.3)
    found = after(both, Rays(returns(40.0)))
    assert found.existence is not None
    assert found.existence > 0.9


def test_what_the_lidar_knew_lasts_a_while_when_it_loses_it() -> None:
    state = ExistenceState()
    for item in [fused(1, 12.0, source="VL")] * 5 + [camera_car(score=0.4)]:
        state, (found,) = weigh(state, (item,), Rays(NOTHING), FRAME, moment(None, 0.1), PARAMS)
    assert found.existence is not None
    assert found.existence > 0.9


def seen_through(frames: int = 5) -> ExistenceState:
    state = ExistenceState()
    for _ in range(frames):
        state, (found,) = weigh(state, (camera_car(score=0.7),), Rays(returns(40.0)), FRAME, moment(None, 0.1), PARAMS)
    assert found.existence is not None
    assert found.existence < 0.2
    return state


def existence_after(
    state: ExistenceState, item: FusedObject, frames: int = 1, params: ExistenceParams = PARAMS
) -> float:
    for _ in range(frames):
        state, (found,) = weigh(state, (item,), Rays(NOTHING), FRAME, moment(None, 0.1), params)
    assert found.existence is not None
    return found.existence


def test_that_a_place_was_empty_says_nothing_of_another_place() -> None:
    """The camera's position was reset to one far from where the LiDAR looked through it."""
    car = camera_car(45.0, score=0.7)
    kept = seen_through()
    assert existence_after(kept, car) < 0.5
    begun = ExistenceState({1: kept.known[1]._replace(last=last_place(replace(car, camera_ranges=12)))})
    assert existence_after(begun, replace(car, camera_ranges=1)) > 0.85


def test_a_box_that_gets_another_number_is_no_more_credible() -> None:
    """The LiDAR looked through it for seconds; then its number went to the cluster of its neighbour."""
    box = replace(camera_car(45.0, score=0.7), vision_track=7)
    state = ExistenceState(seen_through().known, {7: 1})
    assert existence_after(state, replace(box, id=2)) < 0.5
    assert existence_after(ExistenceState(state.known), replace(box, id=2)) > 0.85, "without its track, it is new"


def test_a_box_that_gets_another_number_leaves_what_the_lidar_saw_to_the_old_one() -> None:
    box = replace(camera_car(45.0, score=0.4), vision_track=7, id=2)
    state = ExistenceState({1: Existence(0.4, 4.0)}, {7: 1})
    assert existence_after(state, box) < 0.5
    assert existence_after(state, replace(box, id=1)) > 0.9


@pytest.mark.parametrize(("ranges", "kept"), [(21, True), (1, False)], ids=["followed on", "begun anew"])
def test_that_a_place_was_taken_says_nothing_of_another_place(ranges: int, kept: bool) -> None:
    car = replace(camera_car(45.0, score=0.4), camera_ranges=ranges)
    known = ExistenceState({1: Existence(0.4, 4.0, last_place(replace(car, camera_ranges=20)))})
    assert (existence_after(known, car) > 0.9) == kept


@pytest.mark.parametrize(("lidar_m", "kept"), [(50.0, True), (70.0, False)], ids=["about there", "far from there"])
def test_what_the_lidar_saw_ends_where_the_camera_alone_places_it_elsewhere(lidar_m: float, kept: bool) -> None:
    car = replace(camera_car(45.0, score=0.4), distance_sigma_m=3.0)
    seen = replace(car, source="VL", seen_by="VL", distance_m=lidar_m, distance_sigma_m=0.2)
    known = ExistenceState({1: Existence(0.4, 4.0, last_place(seen))})
    assert (existence_after(known, car) > 0.9) == kept
    assert existence_after(known, car, params=ExistenceParams(forget_at_takeover=False)) > 0.9


def test_an_empty_place_is_forgotten_where_the_lidar_cannot_tell_any_more() -> None:
    car = camera_car(45.0, score=0.7)
    assert existence_after(seen_through(), car, 5) < 0.5
    assert existence_after(seen_through(), car, 30) > 0.85
    assert existence_after(seen_through(), replace(car, returns=2), 8) > 0.85, "returns of its own say the contrary"


EMPTY = RawBoxes("net", np.zeros((0, 4), np.float32), np.zeros(0, np.float32), ())
IMAGE = Frame(0, "0", 0, image=CameraImage(None, np.zeros((720, 1280, 3), np.uint8)), raw_boxes=EMPTY)


def unseen(followed: int, images: int, frame: Frame = IMAGE, *others: FusedObject, u: float = 600.0) -> float:
    """Existence of a camera-only car 50 m away, seen in this many images with a score of 0.7, then missed."""
    car = replace(camera_car(50.0, score=0.7), bbox=(u, 350.0, u + 30.0, 375.0))
    state = ExistenceState()
    for k in range(followed):
        state, _ = weigh(state, (car,), Rays(NOTHING), IMAGE, moment(None, 0.1 if k else None), PARAMS)
    for _ in range(images):
        carried = replace(car, seen_by="")
        state, (found, *_) = weigh(state, (carried, *others), Rays(NOTHING), frame, moment(None, 0.1), PARAMS)
    assert found.existence is not None
    return found.existence


def test_a_burst_of_false_boxes_is_over_when_it_ends_and_a_car_that_is_missed_is_not() -> None:
    assert unseen(3, 4) < CipvParams().stay_probability
    assert unseen(40, 4) > 0.6


@pytest.mark.parametrize(
    ("case", "frame", "others", "u"),
    [
        ("nobody looked", replace(IMAGE, raw_boxes=None), (), 600.0),
        ("it has left the image", IMAGE, (), 1270.0),
        ("a nearer car hides it", IMAGE, (replace(fused(2, 10.0), bbox=(500.0, 300.0, 700.0, 450.0)),), 600.0),
    ],
)
def test_what_could_not_be_seen_is_not_missed(
    case: str, frame: Frame, others: tuple[FusedObject, ...], u: float
) -> None:
    assert unseen(3, 6, frame, *others, u=u) > 0.85, case


def test_where_the_far_view_sits_out_a_frame_nothing_is_missed() -> None:
    far = replace(IMAGE, raw_boxes=replace(EMPTY, far=(400, 200, 816, 616)))
    state = weigh(ExistenceState(), (), Rays(NOTHING), far, moment(), PARAMS)[0]
    assert state.looks_far
    car = replace(camera_car(50.0, score=0.7), bbox=(600.0, 350.0, 630.0, 375.0))
    state, _ = weigh(state, (car,), Rays(NOTHING), far, moment(None, 0.1), PARAMS)
    known = state.known[1].score
    state, _ = weigh(state, (replace(car, seen_by=""),), Rays(NOTHING), IMAGE, moment(None, 0.1), PARAMS)
    assert state.known[1].score == known
    state, _ = weigh(state, (replace(car, seen_by=""),), Rays(NOTHING), far, moment(None, 0.1), PARAMS)
    assert state.known[1].score < known  # type: ignore[operator]


@pytest.mark.parametrize(
    ("case", "closing_mps", "exists"),
    [("it keeps its distance", 0.0, True), ("it is slower by 5 m/s", 5.0, True), ("it stands", 20.0, False)],
)
def test_a_weak_box_that_goes_along_is_a_vehicle(case: str, closing_mps: float, exists: bool) -> None:
    """At 72 km/h, with scores at which half of all boxes are false."""
    state = ExistenceState()
    for k in range(16):
        car = replace(camera_car(60.0 - 0.1 * closing_mps * k, score=0.45), camera_ranges=k + 1)
        now = moment(EgoState(0, 20.0), 0.1 if k else None)
        state, (found,) = weigh(state, (car,), Rays(NOTHING), FRAME, now, PARAMS)
    assert found.existence is not None
    assert (found.existence > CipvParams().become_existence) == exists, case
    again = replace(car, camera_ranges=1)
    now = moment(EgoState(0, 20.0), 0.1)
    begun = weigh(state, (again,), Rays(NOTHING), FRAME, now, PARAMS)[1][0].existence
    assert begun == pytest.approx(0.5), "a place begun anew may be another thing"


@pytest.mark.parametrize(
    ("case", "first_m", "closing_mps", "along"),
    [
        ("a box at 160 m, then a car that keeps its distance", 160.0, 0.0, True),
        ("a box at 160 m, then a static object", 160.0, 20.0, False),
        ("oncoming at our speed", 60.0, 40.0, False),
    ],
)
def test_a_wrong_first_distance_does_not_hide_that_a_car_goes_along(
    case: str, first_m: float, closing_mps: float, along: bool
) -> None:
    """At 72 km/h, for 2.4 s; the first distance is that of a false box."""
    state = ExistenceState()
    for k in range(24):
        car = replace(camera_car(first_m if k == 0 else 100.0 - 0.1 * closing_mps * k, score=0.45), camera_ranges=k + 1)
        now = moment(EgoState(0, 20.0), 0.1 if k else None)
        state, _ = weigh(state, (car,), Rays(NOTHING), FRAME, now, PARAMS)
    assert state.known[1].goes_along is along, case


@pytest.mark.parametrize(("count", "exists"), [(0, False), (2, False), (3, True)])
def test_what_returns_several_rays_is_there_though_others_pass_over_it(count: int, exists: bool) -> None:
    """Beyond a crest the road is lower than it seems, so rays that pass over a vehicle seem to pass through it."""
    found = after(replace(camera_car(28.0), returns=count), Rays(returns(60.0)))
    assert found.existence is not None
    assert (found.existence > 0.5) is exists


def test_what_is_only_predicted_does_not_go_along() -> None:
    """A weak box on a static object, seen for 0.4 s; then the car drives 36 m without measuring it again."""
    state = ExistenceState()
    for k in range(18):
        car = replace(camera_car(60.0 - 2.0 * min(k, 4), score=0.45), seen_by="V" if k < 5 else "", measured=k < 5)
        now = moment(EgoState(0, 20.0), 0.1 if k else None)
        state, _ = weigh(state, (car,), Rays(NOTHING), FRAME, now, PARAMS)
    assert not state.known[1].goes_along


def test_switched_off_nothing_is_said() -> None:
    found = after(camera_car(), Rays(returns(40.0)), params=ExistenceParams(enabled=False))
    assert (found.existence, gate(found)) == (None, None)
