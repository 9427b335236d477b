"""Building meshes from faces, lofts and wheels.

Axes of a vehicle: x forward, y left, z up from the road, metres, origin on the road below its middle. Faces are in
painting order, valid once back faces are removed.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from pipeline.simulation.drawing.canvas import Colour
from pipeline.types import F64, I64

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
    "trousers": (78.0, 58.0, 48.0),
    "skin": (140.0, 168.0, 212.0),
    "hair": (30.0, 38.0, 52.0),
    "shoes": (30.0, 28.0, 28.0),
}
_GLOWS = frozenset({BRAKE, "head", "plate"})


@dataclass(frozen=True)
class Mesh:
    """F faces with separate corners, one face after another."""

    vertices: F64
    """(V, 3) metres, in the body's own frame."""
    counts: I64
    """(F,) corners of each face."""
    face_of_vertex: I64
    """(V,) index of the face that each corner belongs to."""
    normals: F64
    """(F, 3), outward."""
    middles: F64
    """(F, 3) metres."""
    base: F64
    """(F, 3) blue, green, red."""
    painted: Bools
    """(F,) faces that take the vehicle's colour."""
    brakes: Bools
    """(F,) faces that light up when the vehicle brakes."""
    glows: Bools
    """(F,) faces that are not shaded."""
    group: I64
    """(F,) index of the part; parts are painted far to near."""
    group_x: F64
    """Places of the parts along x, metres."""
    group_y: F64
    """Places of the parts along y, metres."""

    def colours_of(self, paint: Colour, brake: Colour) -> F64:
        """(F, 3) colours of a vehicle with this paint and rear lights, unshaded."""
        colours = self.base.copy()
        colours[self.painted], colours[self.brakes] = paint, brake
        return colours


@dataclass
class MeshBuilder:
    """Collects the faces of a mesh."""

    faces: list[F64] = field(default_factory=list)
    """(K, 3) corners of each."""
    normals: list[F64] = field(default_factory=list)
    """(3,) of each, outward."""
    colours: list[str] = field(default_factory=list)
    """Of each: a colour, or a role such as paint."""
    groups: list[int] = field(default_factory=list)
    """Part that each belongs to."""
    group: int = 0
    """Part that new faces belong to."""

    def face(self, corners: F64, colour: str, outward: tuple[float, float, float]) -> None:
        """A flat face; its normal is oriented along ``outward``."""
        normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        length = float(np.linalg.norm(normal))
        if length < 1e-9:
            return
        normal = normal / length * (1.0 if float(normal @ np.array(outward)) >= 0.0 else -1.0)
        self.faces.append(corners)
        self.normals.append(normal)
        self.colours.append(colour)
        self.groups.append(self.group)

    def loft(
        self, levels: list[tuple[float, float, float, float]], colour: str, chamfer: float = 0.22, y: float = 0.0
    ) -> None:
        """A skin over levels (z, rear x, front x, width) around y, with bevelled corners, and a lid."""
        rings = [_octagon(*level, chamfer) + np.array([0.0, y, 0.0]) for level in levels]
        for low, high in pairwise(rings):
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
            group_y=np.array([middles[groups == g, 1].mean() for g in range(int(groups.max()) + 1)]),
        )


def _octagon(z: float, rear: float, front: float, width: float, chamfer: float) -> F64:
    half, cut = width / 2, min(chamfer, width / 4)
    outline = [
        (front, half - cut), (front - cut, half), (rear + cut, half), (rear, half - cut),
        (rear, cut - half), (rear + cut, -half), (front - cut, -half), (front, cut - half),
    ]  # fmt: skip
    return np.array([(x, y, z) for x, y in outline])
