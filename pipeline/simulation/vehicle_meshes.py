"""What vehicles look like: lofted bodies with windows, lights, plates and wheels, in metres.

Axes of a vehicle: x forward, y left, z up from the road, origin on the road below its middle. Faces are listed in the
order in which they may be painted once those that look away are left out.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from pipeline.simulation.canvas import Colour, Ints
from pipeline.types import F64

Bools = npt.NDArray[np.bool_]
BODY, BRAKE = "body", "brake"
"""Colours that depend on the vehicle: its paint, and its rear lights (brighter while braking)."""
_COLOURS = {
    "glass": (52.0, 44.0, 38.0),
    "sky_glass": (150.0, 138.0, 122.0),
    "dark": (34.0, 32.0, 31.0),
    "tyre": (26.0, 25.0, 25.0),
    "rim": (150.0, 148.0, 146.0),
    "plate": (238.0, 240.0, 240.0),
    "plate_band": (150.0, 60.0, 20.0),
    "head": (250.0, 252.0, 252.0),
    "chrome": (190.0, 190.0, 188.0),
    "box": (216.0, 218.0, 220.0),
    "seam": (120.0, 122.0, 124.0),
    "tape": (40.0, 40.0, 205.0),
    "jacket": (50.0, 46.0, 110.0),
}
_GLOWS = frozenset({BRAKE, "head", "plate"})


@dataclass(frozen=True)
class Mesh:
    """F faces, each with corners of its own, one face after another.

    vertices: (V, 3). counts: (F,) corners of each face. face_of_vertex: (V,). normals: (F, 3), outward. middles:
    (F, 3). base: (F, 3) blue green red. painted, brakes: (F,) whose colour the vehicle decides. glows: (F,) not
    shaded. group: (F,) index of the part; parts are painted far to near, group_x: their places along x.
    """

    vertices: F64
    counts: Ints
    face_of_vertex: Ints
    normals: F64
    middles: F64
    base: F64
    painted: Bools
    brakes: Bools
    glows: Bools
    group: Ints
    group_x: F64

    def colours_of(self, paint: Colour, brake: Colour) -> F64:
        """(F, 3) colours of a vehicle with this paint and rear lights, unshaded."""
        colours = self.base.copy()
        colours[self.painted], colours[self.brakes] = paint, brake
        return colours


@dataclass
class _Builder:
    faces: list[F64] = field(default_factory=list)
    normals: list[F64] = field(default_factory=list)
    colours: list[str] = field(default_factory=list)
    groups: list[int] = field(default_factory=list)
    group: int = 0

    def face(self, corners: F64, colour: str, outward: tuple[float, float, float]) -> None:
        """A flat face; its normal is turned to the side of ``outward``."""
        normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        length = float(np.linalg.norm(normal))
        if length < 1e-9:
            return
        normal = normal / length * (1.0 if float(normal @ np.array(outward)) >= 0.0 else -1.0)
        self.faces.append(corners)
        self.normals.append(normal)
        self.colours.append(colour)
        self.groups.append(self.group)

    def loft(self, levels: list[tuple[float, float, float, float]], colour: str, chamfer: float = 0.22) -> None:
        """A skin over levels (z, rear x, front x, width), with bevelled corners, and a lid."""
        rings = [_octagon(*level, chamfer) for level in levels]
        for low, high in zip(rings[:-1], rings[1:], strict=True):
            middle = (low.mean(axis=0) + high.mean(axis=0)) / 2
            for i in range(8):
                j = (i + 1) % 8
                corners = np.array([low[i], low[j], high[j], high[i]])
                self.face(corners, colour, tuple(corners.mean(axis=0) - middle))
        self.face(rings[-1], colour, (0.0, 0.0, 1.0))

    def across(self, x: tuple[float, float], y: tuple[float, float], z: tuple[float, float], colour: str) -> None:
        """A quad that faces backwards or forwards: x at its lower and upper edge, y and z from–to."""
        corners = np.array([[x[0], y[0], z[0]], [x[0], y[1], z[0]], [x[1], y[1], z[1]], [x[1], y[0], z[1]]])
        self.face(corners, colour, (1.0 if x[0] > 0 else -1.0, 0.0, 0.0))

    def side(self, outline: list[tuple[float, float]], y: tuple[float, float], colour: str) -> None:
        """The same flat face on the left and on the right: outline of (x, z), half width at its lowest and highest."""
        flat = np.array(outline)
        share = (flat[:, 1] - flat[:, 1].min()) / max(float(np.ptp(flat[:, 1])), 1e-9)
        half = y[0] + share * (y[1] - y[0])
        for sign in (1.0, -1.0):
            self.face(np.column_stack([flat[:, 0], sign * half, flat[:, 1]]), colour, (0.0, sign, 0.0))

    def wheels(self, places: list[float], half_width: float, radius: float) -> None:
        turn = np.linspace(0.0, 2 * np.pi, 16, endpoint=False)
        for x in places:
            for scale, colour, out in ((1.16, "dark", 0.004), (1.0, "tyre", 0.008), (0.62, "rim", 0.012)):
                disc = [
                    (float(x + scale * radius * np.cos(a)), float(max(radius + scale * radius * np.sin(a), 0.0)))
                    for a in turn
                ]
                self.side(disc, (half_width + out, half_width + out), colour)

    def tyre_backs(self, places: list[float], half_width: float, radius: float) -> None:
        """The tyres as seen from behind or ahead, below the body."""
        for x in places:
            for sign in (1.0, -1.0):
                inner, outer = sign * (half_width - 0.24), sign * (half_width - 0.02)
                for face_x, looks in ((x - radius * 0.8, -1.0), (x + radius * 0.8, 1.0)):
                    corners = [[face_x, inner, 0], [face_x, outer, 0], [face_x, outer, radius], [face_x, inner, radius]]
                    self.face(np.array(corners, dtype=float), "tyre", (looks, 0.0, 0.0))

    def build(self) -> Mesh:
        counts = np.array([len(face) for face in self.faces])
        middles = np.array([face.mean(axis=0) for face in self.faces])
        groups = np.array(self.groups)
        return Mesh(
            vertices=np.concatenate(self.faces),
            counts=counts,
            face_of_vertex=np.repeat(np.arange(len(counts)), counts),
            normals=np.array(self.normals),
            middles=middles,
            base=np.array([_COLOURS.get(colour, (0.0, 0.0, 0.0)) for colour in self.colours]),
            painted=np.array([colour == BODY for colour in self.colours]),
            brakes=np.array([colour == BRAKE for colour in self.colours]),
            glows=np.array([colour in _GLOWS for colour in self.colours]),
            group=groups,
            group_x=np.array([middles[groups == g, 0].mean() for g in range(int(groups.max()) + 1)]),
        )


@lru_cache(maxsize=64)
def mesh(kind: str, size_m: tuple[float, float, float]) -> Mesh:
    """The mesh of a kind of vehicle at a length, width and height."""
    builder = _Builder()
    {"car": _car, "van": _van, "truck": _truck, "bus": _bus, "motorcycle": _motorcycle}[kind](builder, *size_m)
    return builder.build()


def _octagon(z: float, rear: float, front: float, width: float, chamfer: float) -> F64:
    half, cut = width / 2, min(chamfer, width / 4)
    outline = [
        (front, half - cut), (front - cut, half), (rear + cut, half), (rear, half - cut),
        (rear, cut - half), (rear + cut, -half), (front - cut, -half), (front, cut - half),
    ]  # fmt: skip
    return np.array([(x, y, z) for x, y in outline])


def _car(b: _Builder, length: float, width: float, height: float) -> None:
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


def _van(b: _Builder, length: float, width: float, height: float) -> None:
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


def _rear(b: _Builder, r: float, w: float, light: tuple[float, float], plate: float, lean: float) -> None:
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


def _front(b: _Builder, f: float, w: float) -> None:
    x = f + 0.024
    b.across((x, x), (-w / 2 + 0.35, w / 2 - 0.35), (0.28, 0.50), "dark")
    b.across((x + 0.004, x + 0.004), (-0.26, 0.26), (0.36, 0.47), "plate")
    for sign in (1.0, -1.0):
        b.across((x, x - 0.04), (sign * (w / 2 - 0.52), sign * (w / 2 - 0.24)), (0.50, 0.62), "head")


def _cabin(
    b: _Builder,
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
    for (inner, (end_low, end_high)) in (
        (behind, (blend(at[0], low) + 0.22, blend(at[0], high) + 0.2)),
        (ahead, (blend(at[1], low) - 0.25, blend(at[1], high) - 0.16)),
    ):
        b.side([(end_low, low), (inner, low), (inner, high), (end_high, high)], half, "glass")


def _truck(b: _Builder, length: float, width: float, height: float) -> None:
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


def _bus(b: _Builder, length: float, width: float, height: float) -> None:
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


def _motorcycle(b: _Builder, length: float, width: float, height: float) -> None:
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
