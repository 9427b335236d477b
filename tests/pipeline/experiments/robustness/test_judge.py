"""What counts as a phantom, a misplaced lead and a missed one, on a random drive with results made by hand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import islice

import pytest

from pipeline.common.fast_replace import evolve
from pipeline.experiments.robustness import traffic
from pipeline.experiments.robustness.judge import Judge
from pipeline.experiments.true_lead import ScriptedWay, near_face, true_lead
from pipeline.params import Params
from pipeline.simulation.scenario import Scenario
from pipeline.simulation.sensors.truth_boxes import in_image
from pipeline.simulation.unseen import frames
from pipeline.simulation.world.world_state import ActorState, World
from pipeline.step import State, step
from pipeline.types import Box, CameraCalibration, Cipv, FusedObject, Point2, Result

FRAMES = 12
"""Longer than the time for which a lead may be missed."""
Choice = Callable[[FusedObject, ActorState, Box], FusedObject | None]
Parks = Callable[[Point2], Point2]


@cache
def drive() -> tuple[Scenario, tuple[tuple[World, CameraCalibration, Result], ...]]:
    """The first drive whose true lead is visible and chosen for a while, from that moment on."""
    for number in range(20):
        scene, state, found = traffic.scenario(5, number), State(), []
        way = ScriptedWay.of(scene)
        for now, frame in islice(frames(scene), 40):
            state, result = step(state, frame, Params())
            path = way.ahead(now)
            lead, doubtful = true_lead(now, path) if path is not None else (None, True)
            if lead is None or doubtful or result.cipv is None or frame.camera is None:
                found = []
                continue
            found.append((now, frame.camera, result))
            if len(found) == FRAMES:
                return scene, tuple(found)
    raise AssertionError("no drive of these has a lead")


def judged(choose: Choice, parked: Parks | None = None) -> set[tuple[str, str]]:
    """Kinds and causes of the failures, with the chosen object replaced in every frame after the first. parked: where
    another vehicle of the drive is put, given the lead's nearest face."""
    scene, moments = drive()
    judge, way = Judge(scene, 1.0 / scene.rate_hz), ScriptedWay.of(scene)
    for now, camera, result in moments:
        path = way.ahead(now)
        assert path is not None
        lead, _ = true_lead(now, path)
        chosen = result.chosen()
        assert lead is not None
        assert chosen is not None
        if parked is not None:
            now = with_another_at(now, lead, parked(near_face(lead)))
        box = next(each.bbox for each in in_image(now, camera) if each.actor is lead)
        other = choose(chosen, lead, box)
        assert result.cipv is not None
        cipv = replace(result.cipv, id=other.id) if other is not None else None
        objects = (other,) if other is not None else ()
        judge.take(now, camera, evolve(result, objects=objects, cipv=cipv, acc=None))
    return {(each.kind, each.cause) for each in judge.failures}


def with_another_at(now: World, lead: ActorState, where: Point2) -> World:
    """The world with another of its vehicles there, heading as the lead does."""
    other = next(each for each in now.actors if each is not lead)
    center = (*where, lead.cuboid.center[2])
    moved = evolve(other, cuboid=other.cuboid._replace(center=center, yaw_rad=lead.cuboid.yaw_rad))
    return replace(now, actors=tuple(moved if each is other else each for each in now.actors))


def at(item: FusedObject, where: Point2, box: Box | None) -> FusedObject:
    return evolve(
        item,
        source="V",
        bev=None,
        bbox=box,
        closest_point=(*where, 0.0),
        distance_m=(where[0] ** 2 + where[1] ** 2) ** 0.5,
    )


def ahead_of(lead: ActorState, factor: float) -> Point2:
    x, y = near_face(lead)
    return x * factor, y * factor


@pytest.mark.parametrize(
    ("case", "choose", "expected"),
    [
        ("the lead where it is", lambda item, lead, box: at(item, near_face(lead), box), set()),
        ("10 % too near", lambda item, lead, box: at(item, ahead_of(lead, 0.9), box), set()),
        (
            "a third too near, in its own box",
            lambda item, lead, box: at(item, ahead_of(lead, 0.6), box),
            {("lead misplaced", "true vehicle placed too near")},
        ),
        (
            "nothing where there is nothing",
            lambda item, lead, box: at(item, ahead_of(lead, 0.6), (0.0, 0.0, 30.0, 30.0)),
            {("phantom lead", "nothing there, by camera"), ("lead missed", "another object leads")},
        ),
        ("no choice", lambda item, lead, box: None, {("lead missed", "no lead")}),
    ],
)
def test_what_counts_as_which_failure(case: str, choose: Choice, expected: set[tuple[str, str]]) -> None:
    first = iter([True])

    def after_the_first(item: FusedObject, lead: ActorState, box: Box) -> FusedObject | None:
        return at(item, near_face(lead), box) if next(first, False) else choose(item, lead, box)

    found = {(kind, cause.split(", true lead")[0]) for kind, cause in judged(after_the_first)}
    assert found == expected, case


def test_a_misplaced_lead_is_no_phantom_where_another_vehicle_is_parked() -> None:
    def beside(lead: Point2) -> Point2:
        return lead[0] * 0.6, lead[1] * 0.6 + 3.0

    found = judged(lambda item, lead, box: at(item, ahead_of(lead, 0.6), box), beside)
    assert {kind for kind, _ in found} == {"lead misplaced"}

    in_no_box = judged(lambda item, lead, box: at(item, ahead_of(lead, 0.6), None), beside)
    assert {kind for kind, _ in in_no_box} == {"phantom lead", "lead late"}


def test_nothing_is_judged_after_the_script_drove_into_a_vehicle() -> None:
    scene, moments = drive()
    judge = Judge(scene, 1.0 / scene.rate_hz)
    for k, (now, camera, result) in enumerate(moments):
        if k == 1:
            (body, *others) = now.actors
            hit = evolve(body, cuboid=body.cuboid._replace(center=(0.0, 0.0, 0.75)))
            now = replace(now, actors=(hit, *others))
        judge.take(now, camera, evolve(result, cipv=None, acc=None))
        assert judge.is_over is (k >= 1)
    assert not judge.failures, "no lead in twelve frames, eleven of them after the contact"


@pytest.mark.parametrize(
    ("case", "choose", "expected"),
    [
        ("the lead itself", lambda item, lead, box: at(item, near_face(lead), box), set()),
        ("the lead's box, a third too near", lambda item, lead, box: at(item, ahead_of(lead, 0.6), box), set()),
        (
            "nothing where there is nothing",
            lambda item, lead, box: at(item, ahead_of(lead, 0.6), (0.0, 0.0, 30.0, 30.0)),
            {("phantom next lead", "nothing there, by camera")},
        ),
    ],
)
def test_a_next_lead_is_a_vehicle_that_the_car_could_meet(
    case: str, choose: Callable[[FusedObject, ActorState, Box], FusedObject], expected: set[tuple[str, str]]
) -> None:
    scene, moments = drive()
    judge, way = Judge(scene, 1.0 / scene.rate_hz), ScriptedWay.of(scene)
    for now, camera, result in moments:
        path, chosen = way.ahead(now), result.chosen()
        assert path is not None
        assert chosen is not None
        lead, _ = true_lead(now, path)
        assert lead is not None
        other = evolve(choose(chosen, lead, next(x.bbox for x in in_image(now, camera) if x.actor is lead)), id=999)
        following = Cipv(999, other.distance_m or 0.0, None, None, "next")
        judge.take(now, camera, evolve(result, objects=(chosen, other), next_cipv=following, acc=None))
    assert {(each.kind, each.cause) for each in judge.failures if each.kind == "phantom next lead"} == expected, case
