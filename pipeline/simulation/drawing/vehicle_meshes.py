"""Shapes of motor vehicles: lofted bodies with windows, lights, plates and wheels, in metres."""

from __future__ import annotations

import numpy as np

from pipeline.simulation.drawing.mesh_builder import BODY, BRAKE, MeshBuilder


def car(b: MeshBuilder, length: float, width: float, height: float) -> None:
    r, f, w, h = -length / 2, length / 2, width, height
    axles = [r + 0.19 * length, f - 0.19 * length]
    b.tyre_backs(axles, w / 2, 0.32)
    b.across((r + 0.3, r + 0.3), (-w / 2 + 0.2, w / 2 - 0.2), (0.14, 0.30), "dark")
    belt = 0.655 * h
    body = [(0.20, r + 0.10, f - 0.10, w - 0.16), (0.42, r, f, w - 0.02), (0.62, r, f - 0.04, w)]
    b.loft([*body, (belt, r + 0.09, f - 0.42, w - 0.14)], BODY)
    _rear(b, r, w, light=(0.62, 0.80), plate=0.52, lean=0.05)
    _front(b, f - 0.02, w)
    b.side([(r + 0.25, 0.20), (f - 0.25, 0.20), (f - 0.25, 0.29), (r + 0.25, 0.29)], (w / 2, w / 2), "dark")
    b.wheels(axles, w / 2, 0.32)
    glass = (belt + 0.03, h - 0.07)
    cabin = ((r + 0.22, r + 0.74), (f - 1.12, f - 2.05), (w - 0.20, w - 0.56))
    _cabin(b, (belt, h), glass, cabin)


def van(b: MeshBuilder, length: float, width: float, height: float) -> None:
    r, f, w, h = -length / 2, length / 2, width, height
    axles = [r + 0.19 * length, f - 0.17 * length]
    b.tyre_backs(axles, w / 2, 0.35)
    belt = 0.52 * h
    body = [(0.24, r + 0.06, f - 0.10, w - 0.12), (0.45, r, f, w), (0.80, r, f - 0.04, w)]
    b.loft([*body, (belt, r + 0.02, f - 0.35, w - 0.03)], BODY, 0.16)
    _rear(b, r, w, light=(0.78, 1.10), plate=0.62, lean=0.02)
    _front(b, f - 0.02, w)
    b.wheels(axles, w / 2, 0.35)
    cabin = ((r + 0.03, r + 0.12), (f - 0.75, f - 1.45), (w - 0.05, w - 0.24))
    _cabin(b, (belt, h), (belt + 0.06, h - 0.28), cabin)


def _rear(b: MeshBuilder, r: float, w: float, light: tuple[float, float], plate: float, lean: float) -> None:
    """Lights, plate, bumper and boot seam of a car's rear."""
    x, up = r - 0.004, r - 0.004 + lean
    b.across((x + 0.03, x), (-w / 2 + 0.22, w / 2 - 0.22), (0.24, 0.40), "dark")
    b.across((x, x), (-0.27, 0.27), (plate - 0.06, plate + 0.06), "plate")
    b.across((x - 0.002, x - 0.002), (0.23, 0.27), (plate - 0.06, plate + 0.06), "plate_band")
    b.across((up, up), (-w / 2 + 0.25, w / 2 - 0.25), (light[1] + 0.03, light[1] + 0.045), "dark")
    for sign in (1.0, -1.0):
        inner, outer = sign * (w / 2 - 0.46), sign * (w / 2 - 0.2)
        b.across((x, up), (inner, outer), light, BRAKE)
        corner = np.array(
            [[x, outer, light[0]], [r + 0.2, sign * (w / 2 + 0.004), light[0]],
             [r + 0.22, sign * (w / 2 - 0.05), light[1]], [up, outer - sign * 0.02, light[1]]]
        )  # fmt: skip
        b.face(corner, BRAKE, (-1.0, sign, 0.0))


def _front(b: MeshBuilder, f: float, w: float) -> None:
    x = f + 0.024
    b.across((x, x), (-w / 2 + 0.35, w / 2 - 0.35), (0.28, 0.50), "dark")
    b.across((x + 0.004, x + 0.004), (-0.26, 0.26), (0.36, 0.47), "plate")
    for sign in (1.0, -1.0):
        b.across((x, x - 0.04), (sign * (w / 2 - 0.52), sign * (w / 2 - 0.24)), (0.50, 0.62), "head")


def _cabin(
    b: MeshBuilder,
    z: tuple[float, float],
    glass: tuple[float, float],
    at: tuple[tuple[float, float], tuple[float, float], tuple[float, float]],
) -> None:
    """The part above the belt line with its windows. at: rear x, front x and width, each at the bottom and the top."""
    (rear_low, rear_high), (front_low, front_high), (wide_low, wide_high) = at
    b.loft([(z[0], rear_low, front_low, wide_low), (z[1], rear_high, front_high, wide_high)], BODY, 0.14)

    def blend(pair: tuple[float, float], height: float) -> float:
        return pair[0] + (pair[1] - pair[0]) * (height - z[0]) / (z[1] - z[0])

    low, high = glass
    shine = low + 0.68 * (high - low)
    for ends, outward in ((at[0], -0.012), (at[1], 0.012)):
        for bottom, top, colour in ((low, high, "glass"), (shine, high - 0.02, "sky_glass")):
            x = (blend(ends, bottom) + outward, blend(ends, top) + outward)
            half = (blend(at[2], bottom) / 2 - 0.2, blend(at[2], top) / 2 - 0.2)
            corners = [[x[0], -half[0], bottom], [x[0], half[0], bottom], [x[1], half[1], top], [x[1], -half[1], top]]
            b.face(np.array(corners), colour, (outward, 0.0, 0.0))
    pillar = (rear_low + front_low) / 2 - 0.05
    half = (blend(at[2], low) / 2 + 0.006, blend(at[2], high) / 2 + 0.006)
    behind, ahead = pillar - 0.05, pillar + 0.05
    for inner, (end_low, end_high) in (
        (behind, (blend(at[0], low) + 0.22, blend(at[0], high) + 0.2)),
        (ahead, (blend(at[1], low) - 0.25, blend(at[1], high) - 0.16)),
    ):
        b.side([(end_low, low), (inner, low), (inner, high), (end_high, high)], half, "glass")


def truck(b: MeshBuilder, length: float, width: float, height: float) -> None:
    r, f, w, h = -length / 2, length / 2, width, height
    box_front = f - 2.5
    axles = [r + 1.2, r + 2.5, r + 3.8]
    b.tyre_backs([axles[0]], w / 2, 0.5)
    b.loft([(0.55, r + 0.1, box_front, w * 0.6), (1.08, r + 0.1, box_front, w * 0.6)], "dark", 0.05)
    b.across((r - 0.01, r - 0.01), (-w / 2 + 0.1, w / 2 - 0.1), (0.45, 0.62), "seam")
    b.loft([(1.08, r, box_front, w), (h, r, box_front, w)], BODY, 0.02)
    x = r - 0.01
    b.across((x, x), (-w / 2 + 0.05, w / 2 - 0.05), (1.10, 1.20), "tape")
    b.across((x, x), (-0.02, 0.02), (1.25, h - 0.12), "seam")
    for y in (-w / 2 + 0.25, w / 2 - 0.25, -0.3, 0.3):
        b.across((x - 0.01, x - 0.01), (y - 0.02, y + 0.02), (1.25, h - 0.12), "chrome")
    for sign in (1.0, -1.0):
        b.across((x, x), (sign * (w / 2 - 0.45), sign * (w / 2 - 0.08)), (0.80, 1.0), BRAKE)
    b.across((x - 0.01, x - 0.01), (-0.26, 0.26), (0.82, 0.94), "plate")
    tape = [(r + 0.2, 1.12), (box_front - 0.2, 1.12), (box_front - 0.2, 1.2), (r + 0.2, 1.2)]
    b.side(tape, (w / 2 + 0.01,) * 2, "tape")
    guard = [(axles[2] + 0.8, 0.5), (box_front - 0.6, 0.5), (box_front - 0.6, 1.0), (axles[2] + 0.8, 1.0)]
    b.side(guard, (w / 2 - 0.02,) * 2, "seam")
    b.wheels(axles, w / 2 - 0.02, 0.5)
    b.group = 1
    b.tyre_backs([f - 1.4], w / 2, 0.5)
    b.loft([(0.35, f - 2.3, f, w - 0.1), (1.6, f - 2.3, f, w - 0.06), (h - 0.35, f - 2.2, f - 0.35, w - 0.25)], BODY)
    face = [[f - 0.02, 0.95, 1.75], [f - 0.02, -0.95, 1.75], [f - 0.24, -0.9, 2.75], [f - 0.24, 0.9, 2.75]]
    b.face(np.array(face), "glass", (1.0, 0.0, 0.0))
    b.across((f + 0.01, f + 0.01), (-w / 2 + 0.4, w / 2 - 0.4), (0.7, 1.4), "dark")
    for sign in (1.0, -1.0):
        b.across((f + 0.02, f + 0.02), (sign * (w / 2 - 0.5), sign * (w / 2 - 0.15)), (0.55, 0.75), "head")
    b.side([(f - 1.7, 1.7), (f - 0.4, 1.7), (f - 0.6, 2.5), (f - 1.7, 2.5)], (w / 2 - 0.03, w / 2 - 0.06), "glass")
    b.wheels([f - 1.4], w / 2 - 0.04, 0.5)


def bus(b: MeshBuilder, length: float, width: float, height: float) -> None:
    r, f, w, h = -length / 2, length / 2, width, height
    b.tyre_backs([r + 2.6], w / 2, 0.48)
    b.loft([(0.32, r, f, w), (1.2, r, f, w), (h, r + 0.05, f - 0.1, w - 0.06)], BODY, 0.2)
    for x, slope in ((r - 0.01, 0.05), (f + 0.01, -0.1)):
        b.across((x, x + slope), (-w / 2 + 0.25, w / 2 - 0.25), (1.45, h - 0.4), "glass")
    for sign in (1.0, -1.0):
        b.across((r - 0.01, r), (sign * (w / 2 - 0.45), sign * (w / 2 - 0.22)), (0.7, 1.2), BRAKE)
        b.across((f + 0.01, f), (sign * (w / 2 - 0.6), sign * (w / 2 - 0.25)), (0.6, 0.8), "head")
    for i in range(6):
        start = r + 0.6 + i * (length - 1.2) / 6
        end = start + (length - 1.2) / 6 - 0.12
        b.side([(start, 1.3), (end, 1.3), (end, h - 0.45), (start, h - 0.45)], (w / 2 + 0.005, w / 2 - 0.02), "glass")
    b.across((r - 0.012, r - 0.012), (-0.26, 0.26), (0.5, 0.62), "plate")
    b.wheels([r + 2.6, f - 2.6], w / 2, 0.48)


def motorcycle(b: MeshBuilder, length: float, width: float, height: float) -> None:
    r, f, w, h = -length / 2, length / 2, width, height
    for x in (r + 0.3, f - 0.3):
        wheel = [(0.0, x - 0.2, x + 0.2, 0.16), (0.3, x - 0.3, x + 0.3, 0.18), (0.6, x - 0.2, x + 0.2, 0.14)]
        b.loft(wheel, "tyre", 0.02)
    b.loft([(0.4, r + 0.3, f - 0.3, 0.3), (0.8, r + 0.1, f - 0.5, 0.36)], BODY, 0.08)
    b.across((r + 0.07, r + 0.1), (-0.1, 0.1), (0.62, 0.74), BRAKE)
    b.across((r + 0.12, r + 0.14), (-0.1, 0.1), (0.44, 0.58), "plate")
    torso = (h - 0.28, -0.22, 0.12, 0.42)
    b.loft([(0.75, -0.45, 0.1, 0.44), (h - 0.5, -0.35, 0.1, w * 0.66), torso], "jacket", 0.12)
    b.loft([(h - 0.28, -0.17, 0.11, 0.22), (h - 0.14, -0.2, 0.14, 0.28), (h, -0.12, 0.06, 0.18)], "dark", 0.08)
