"""Shapes of people on foot and on bicycles, in metres: limbs, torso and head as lofts, far parts painted first."""

from __future__ import annotations

import numpy as np

from pipeline.simulation.drawing.mesh_builder import BODY, MeshBuilder

_SPOKES = 14


def pedestrian(b: MeshBuilder, length: float, width: float, height: float) -> None:
    """Walking: one leg and the other arm ahead. The length is that of a step, the width that across the arms."""
    h, reach = height, length / 2
    for side, step in ((1.0, -1.0), (-1.0, 1.0)):
        y, foot = side * 0.19 * width, step * (reach - 0.14)
        b.loft([(0.0, foot - 0.1, foot + 0.15, 0.1), (0.05 * h, foot - 0.09, foot + 0.08, 0.1)], "shoes", 0.02, y)
        knee, hip = 0.6 * foot + 0.03, 0.0
        leg = [(0.04 * h, foot - 0.06, foot + 0.06, 0.11), (0.27 * h, knee - 0.07, knee + 0.07, 0.13)]
        b.loft([*leg, (0.5 * h, hip - 0.1, hip + 0.09, 0.18)], "trousers", 0.04, y)
        b.group += 1
    for side, step in ((1.0, 1.0), (-1.0, -1.0)):
        y, hand = side * (0.5 * width - 0.05), step * (reach - 0.12)
        b.loft(
            [(0.43 * h, hand - 0.04, hand + 0.05, 0.07), (0.46 * h, hand - 0.04, hand + 0.05, 0.08)], "skin", 0.02, y
        )
        arm = [(0.46 * h, hand - 0.05, hand + 0.05, 0.09), (0.63 * h, 0.3 * hand - 0.06, 0.3 * hand + 0.05, 0.1)]
        b.loft([*arm, (0.81 * h, -0.06, 0.06, 0.1)], BODY, 0.03, y)
        b.group += 1
    torso = [(0.47 * h, -0.11, 0.1, 0.62 * width), (0.56 * h, -0.1, 0.1, 0.58 * width)]
    b.loft([*torso, (0.74 * h, -0.12, 0.12, 0.72 * width), (0.83 * h, -0.09, 0.08, 0.6 * width)], BODY, 0.07)
    _head(b, 0.0, 0.83 * h, h)


def bicycle(b: MeshBuilder, length: float, width: float, height: float) -> None:
    """A bicycle with its rider, who leans forward slightly. The width is that of the handlebar."""
    h = height
    radius = min(0.34, length / 5.0)
    rear, front = -length / 2 + radius, length / 2 - radius
    for x in (rear, front):
        _wheel(b, x, radius)
    crank, saddle, bar = 0.1 * (rear + front) - 0.05, rear + 0.2, front - 0.16
    seat_z, bar_z = 0.53 * h, 0.59 * h
    for start, end in (
        ((rear, radius), (crank, radius - 0.05)),
        ((rear, radius), (saddle, seat_z - 0.12)),
        ((crank, radius - 0.05), (saddle, seat_z)),
        ((crank, radius - 0.05), (bar - 0.02, bar_z - 0.18)),
        ((saddle, seat_z - 0.12), (bar - 0.02, bar_z - 0.14)),
        ((front, radius), (bar, bar_z)),
    ):
        _tube(b, start, end)
    b.loft(
        [(seat_z - 0.04, saddle - 0.14, saddle + 0.12, 0.14), (seat_z, saddle - 0.14, saddle + 0.1, 0.1)], "dark", 0.03
    )
    b.loft([(bar_z - 0.02, bar - 0.03, bar + 0.03, width), (bar_z + 0.02, bar - 0.02, bar + 0.02, width)], "dark", 0.01)
    b.across((rear - radius - 0.01, rear - radius - 0.01), (-0.03, 0.03), (0.36 * h, 0.39 * h), "tape")
    b.group += 1
    _rider(b, (saddle, seat_z), (bar, bar_z), crank, radius, width, h)


def _rider(
    b: MeshBuilder,
    saddle: tuple[float, float],
    bar: tuple[float, float],
    crank: float,
    radius: float,
    width: float,
    h: float,
) -> None:
    """Legs at opposite ends of a turn of the pedals, arms to the handlebar; saddle and bar: x and z."""
    x, z = saddle
    for side, pedal_x, pedal_z in ((1.0, crank + 0.1, radius - 0.13), (-1.0, crank - 0.05, radius + 0.08)):
        y = side * 0.11
        b.loft([(pedal_z, pedal_x - 0.1, pedal_x + 0.15, 0.09), (pedal_z + 0.08, pedal_x - 0.09, pedal_x + 0.06, 0.09)],
               "shoes", 0.02, y)  # fmt: skip
        knee_x, knee_z = x + 0.36, (pedal_z + z) / 2 + 0.12
        shin = [(pedal_z + 0.06, pedal_x - 0.06, pedal_x + 0.05, 0.1), (knee_z, knee_x - 0.08, knee_x + 0.07, 0.13)]
        b.loft([*shin, (z + 0.02, x + 0.02, x + 0.22, 0.16), (z + 0.1, x - 0.1, x + 0.12, 0.17)], "trousers", 0.04, y)
        b.group += 1
    shoulder_x, shoulder_z, across = x + 0.26, 0.83 * h, min(0.42, width * 0.8)
    for side in (1.0, -1.0):
        y = side * (across / 2 + 0.03)
        hand = [(bar[1], bar[0] - 0.08, bar[0] + 0.05, 0.09), (bar[1] + 0.08, bar[0] - 0.12, bar[0] + 0.02, 0.09)]
        b.loft([*hand, (shoulder_z - 0.04, shoulder_x - 0.08, shoulder_x + 0.06, 0.11)], BODY, 0.03, y)
        b.group += 1
    back = [(z, x - 0.13, x + 0.12, 0.32), (0.68 * h, x - 0.04, x + 0.2, 0.34)]
    b.loft(
        [*back, (shoulder_z - 0.05, x + 0.1, x + 0.33, across), (shoulder_z, x + 0.14, x + 0.31, 0.8 * across)],
        BODY,
        0.07,
    )
    _head(b, shoulder_x, shoulder_z, h)


def _head(b: MeshBuilder, x: float, low: float, top: float) -> None:
    """Neck, face and hair, facing forward."""
    size = top - low
    b.loft([(low, x - 0.05, x + 0.05, 0.11), (low + 0.22 * size, x - 0.05, x + 0.05, 0.11)], "skin", 0.03)
    face = low + 0.2 * size
    b.loft([(face, x - 0.06, x + 0.09, 0.12), (face + 0.3 * size, x - 0.09, x + 0.1, 0.16),
            (face + 0.5 * size, x - 0.1, x + 0.1, 0.16)], "skin", 0.05)  # fmt: skip
    b.loft([(face + 0.45 * size, x - 0.105, x + 0.1, 0.165), (face + 0.7 * size, x - 0.1, x + 0.09, 0.16),
            (top, x - 0.05, x + 0.05, 0.08)], "hair", 0.05)  # fmt: skip
    back = x - 0.107
    b.across((back, back), (-0.07, 0.07), (face + 0.12 * size, face + 0.6 * size), "hair")


def _wheel(b: MeshBuilder, x: float, radius: float) -> None:
    """A tyre as a thin ring of faces that can be seen from all sides; one looks through its middle."""
    around = np.linspace(0.0, 2 * np.pi, _SPOKES + 1)
    for first, second in zip(around[:-1].tolist(), around[1:].tolist(), strict=True):
        ring = [
            (x + share * radius * float(np.cos(a)), radius + share * radius * float(np.sin(a)))
            for a, share in ((first, 0.88), (first, 1.0), (second, 1.0), (second, 0.88))
        ]
        b.side(ring, (0.02, 0.02), "tyre")
        outer = np.array([[*ring[1], -0.02], [*ring[2], -0.02], [*ring[2], 0.02], [*ring[1], 0.02]])[:, [0, 2, 1]]
        middle = (first + second) / 2
        b.face(outer, "tyre", (float(np.cos(middle)), 0.0, float(np.sin(middle))))


def _tube(b: MeshBuilder, start: tuple[float, float], end: tuple[float, float]) -> None:
    """A straight part of the frame between two points x, z."""
    (x0, z0), (x1, z1) = start, end
    along = np.array([x1 - x0, z1 - z0]) / max(float(np.hypot(x1 - x0, z1 - z0)), 1e-9)
    dx, dz = -0.018 * along[1], 0.018 * along[0]
    b.side([(x0 - dx, z0 - dz), (x1 - dx, z1 - dz), (x1 + dx, z1 + dz), (x0 + dx, z0 + dz)], (0.02, 0.02), BODY)
    for sign in (1.0, -1.0):
        edge = [[x0 + sign * dx, y, z0 + sign * dz] for y in (-0.02, 0.02)]
        edge += [[x1 + sign * dx, y, z1 + sign * dz] for y in (0.02, -0.02)]
        b.face(np.array(edge), BODY, (sign * dx, 0.0, sign * dz))
