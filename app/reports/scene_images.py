"""Images of a simulated scene for a report: a plan from above with all trajectories, and the camera image."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterable
from html import escape

import cv2
import numpy as np

from pipeline.evaluation.report_sections import Scene
from pipeline.simulation.scenario import Scenario
from pipeline.simulation.sensors.rig import SensorRig
from pipeline.simulation.world import world_state
from pipeline.simulation.world.world_state import World
from pipeline.types import F64

_BEHIND_M, _AHEAD_M, _ASIDE_M = 12.0, 108.0, 30.0
_EGO_SIZE_M = (4.5, 1.82)
_WAY_S, _WAY_STEP_S = 4.0, 0.25
_ROAD_STEP_M, _GRID_M = 3.0, 20.0
_IMAGE_PX, _JPEG_QUALITY = (640, 360), 75


def scene_html(scene: Scene) -> str:
    """A figure with the plan and, below it, the first camera's image at the same moment."""
    now = world_state.at(scene.scenario, scene.t_s)
    title = f"{scene.title}, at {scene.t_s:.1f} s"
    return (
        f'<figure class="scene"><figcaption>{escape(title)}</figcaption>{plan_svg(scene.scenario, now, title)}'
        f'<img src="{_image(scene.scenario, now)}" alt="{escape(title)}: what the camera sees"></figure>'
    )


def plan_svg(scenario: Scenario, now: World, title: str) -> str:
    """Plan of the road, the vehicles and their trajectories over the next 4 s, from 12 m behind to 108 m ahead of the
    ego vehicle, which drives to the right."""
    parts = [*_road(scenario, now), *_grid(), *_ways(scenario, now), *_vehicles(now)]
    box = f"{-_BEHIND_M:g} {-_ASIDE_M:g} {_BEHIND_M + _AHEAD_M:g} {2 * _ASIDE_M:g}"
    return (
        f'<svg viewBox="{box}" class="plan" role="img" aria-label="{escape(title)}: plan from above">'
        f"{''.join(parts)}</svg>"
    )


def _road(scenario: Scenario, now: World) -> Iterable[str]:
    road = scenario.road
    reach = _AHEAD_M + 2 * _ASIDE_M
    along = np.arange(now.s_m - reach, now.s_m + reach, _ROAD_STEP_M)

    def line(d_m: float) -> F64:
        return now.to_ego(road.to_world(along, d_m))

    for right, left in road.edges_m():
        yield _closed(np.vstack([line(right), line(left)[::-1]]), "tarmac")
    for crossing, middle in zip(road.crossings, road.crossing_lines, strict=True):
        across, half = np.arange(-reach, reach, _ROAD_STEP_M), crossing.half_width_m()
        sides = [now.to_ego(middle.to_world(across, d_m)) for d_m in (-half, half)]
        yield _closed(np.vstack([sides[0], sides[1][::-1]]), "tarmac")
    for lines_m in road.lane_lines_m():
        for d_m in sorted(lines_m):
            yield _open(line(d_m), "paint")


def _grid() -> Iterable[str]:
    for x in np.arange(0.0, _AHEAD_M, _GRID_M).tolist():
        yield f'<line class="mark" x1="{x:g}" x2="{x:g}" y1="{_ASIDE_M - 1.5:g}" y2="{_ASIDE_M:g}"/>'
        yield f'<text x="{x + 0.6:g}" y="{_ASIDE_M - 0.6:g}">{x:g} m</text>'


def _ways(scenario: Scenario, now: World) -> Iterable[str]:
    """SVG of each vehicle's future trajectory, in the current ego frame."""
    later = [world_state.at(scenario, now.t_s + t_s) for t_s in np.arange(0.0, _WAY_S, _WAY_STEP_S).tolist()]
    yield _open(now.to_ego(np.array([each.pose[:2] for each in later])), "way ego")
    for number in sorted(state.actor.id for state in now.actors):
        places = [
            _in_the_world(each, state.cuboid.center[:2])
            for each in later
            for state in each.actors
            if state.actor.id == number
        ]
        yield _open(now.to_ego(np.array(places)), "way")


def _in_the_world(now: World, place: tuple[float, float]) -> tuple[float, float]:
    x, y, heading = now.pose
    c, s = np.cos(heading), np.sin(heading)
    return float(x + c * place[0] - s * place[1]), float(y + s * place[0] + c * place[1])


def _vehicles(now: World) -> Iterable[str]:
    length, width = _EGO_SIZE_M
    yield _closed(np.array([[-length, -width / 2], [0, -width / 2], [0, width / 2], [-length, width / 2]]), "car ego")
    for state in now.actors:
        yield _closed(state.cuboid.footprint(), "car", state.actor.colour)


def _closed(points: F64, kind: str, colour: str = "") -> str:
    fill = f' style="fill:{escape(colour)}"' if colour else ""
    return f'<polygon class="{kind}"{fill} points="{_points(points)}"/>'


def _open(points: F64, kind: str) -> str:
    return f'<polyline class="{kind}" points="{_points(points)}"/>'


def _points(points: F64) -> str:
    """Coordinates for SVG: x to the right, y up."""
    return " ".join(f"{x:.2f},{-y:.2f}" for x, y in points[:, :2])


def _image(scenario: Scenario, now: World) -> str:
    """The camera image as a data URL."""
    sensors = SensorRig(scenario, now.s_m)
    drawn = sensors.frame(now, 0, round(now.t_s * 1e9)).image
    assert drawn is not None
    small = cv2.resize(drawn.bgr, _IMAGE_PX, interpolation=cv2.INTER_AREA)
    _, jpeg = cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
    return f"data:image/jpeg;base64,{b64encode(jpeg.tobytes()).decode()}"
