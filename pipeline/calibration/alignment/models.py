"""The two models as numbers to fit: search ranges, and the parameters that result.

A pinhole model keeps the lens of the recording's calibration. The angular model has no mount, so its origin stands for
yaw and pitch, and its two resolutions for the lens.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np

from pipeline.alignment.projection import Alignment, Angular, angular_from_calibration, pinhole, resolve
from pipeline.params import AlignmentParams
from pipeline.types import F64, CameraCalibration

ModelName = Literal["angular", "pinhole"]

REACH_DEG = 10.0
"""Search range of the mount around the recording's calibration, in all directions."""
FARTHEST_OFF_M = 1.0
"""Maximum distance of the camera's position from that in the calibration."""
PLACE = ("forward_m", "left_m", "up_m")
"""The parameters of the camera's position."""
ROLL_SIGMA_DEG = 5.0
"""Prior standard deviation of the roll, if neither boxes nor edges determine it."""
STEP_DEG = 1.0
"""Step of the coarse search over mounts; the coarse score varies slowly enough for it."""
VIEWS_DEG = (20.0, 130.0)
"""Range of horizontal fields of view that is searched without a calibration."""
ZOOM_STEP = 1.12
"""Step of the coarse search over focal lengths: the sides of a car move by 6 % of its width."""
ZOOM_REACH = 1.35
"""Search range of the focal length, as a factor on the calibration's in both directions."""
ZOOMS = 2
"""Steps of the coarse search over a pinhole model's focal length, to either side."""
_DEFAULTS = AlignmentParams().model_dump()


class _Mount(NamedTuple):
    """What a pinhole model corrects, without the checks of ``AlignmentParams``, which take longer than projecting."""

    roll_deg: float = AlignmentParams().roll_deg
    pitch_deg: float = AlignmentParams().pitch_deg
    yaw_deg: float = AlignmentParams().yaw_deg
    forward_m: float = AlignmentParams().forward_m
    left_m: float = AlignmentParams().left_m
    up_m: float = AlignmentParams().up_m
    zoom: float = AlignmentParams().zoom


@dataclass(frozen=True)
class FitModel:
    """A model of one camera. Vectors of unknowns are in degrees and metres (pinhole, with the logarithm of the
    zoom), or in logarithms and degrees (angular)."""

    name: ModelName
    """Which of the two projections it is."""
    camera: CameraCalibration | None
    """The recording's calibration; not needed for the angular model."""
    size: tuple[int, int]
    """Width and height of the images."""
    offset: bool = False
    """Pinhole: whether the camera's position is also fitted, laterally and in height. Boxes do not determine it along
    the optical axis."""
    roll_deg: tuple[float, float] = (0.0, ROLL_SIGMA_DEG)
    """Pinhole: what is known of the roll besides the boxes, and its standard deviation."""
    place_m: Mapping[str, float] = field(default_factory=dict)
    """Pinhole: shift of the camera's position by parameter, as far as it is not fitted."""
    zoom: float | None = 1.0
    """Pinhole: factor on the calibration's focal length; None: it is also fitted."""

    @property
    def unknowns(self) -> tuple[str, ...]:
        """The fitted parameters, in the order of the vector."""
        if self.name == "pinhole":
            place = ("left_m", "up_m") if self.offset else ()
            return ("yaw_deg", "pitch_deg", "roll_deg", *place, *(("zoom",) if self.zoom is None else ()))
        return ("h_res_deg", "v_res_deg", "cx_px", "cy_px")

    def values(self, vector: F64) -> dict[str, float]:
        """The vector as parameter values."""
        if self.name == "pinhole":
            found = dict(zip(self.unknowns, map(float, vector), strict=True))
            return found | {"zoom": float(np.exp(found["zoom"]))} if self.zoom is None else found
        h, v = np.exp(vector[:2])
        return {
            "h_res_deg": float(h),
            "v_res_deg": float(v),
            "cx_px": float(self.size[0] / 2 + vector[2] / h),
            "cy_px": float(self.size[1] / 2 + vector[3] / h),
        }

    def vector(self, params: AlignmentParams) -> F64 | None:
        """Current parameters as a vector, if they are complete."""
        if self.name == "pinhole":
            found = [getattr(params, name) for name in self.unknowns]
            return np.array([*found[:-1], np.log(found[-1])] if self.zoom is None else found)
        aligned = resolve(params.model_copy(update={"model": "angular"}), self.camera)
        if not isinstance(aligned, Angular):
            return None
        h, v = np.degrees([aligned.h_res_rad, aligned.v_res_rad])
        cx, cy = aligned.cx - self.size[0] / 2, aligned.cy - self.size[1] / 2
        return np.array([np.log(h), np.log(v), cx * h, cy * h])

    def params(self, vector: F64) -> AlignmentParams:
        """As parameters, not rounded or clipped, for use during the search."""
        return AlignmentParams.model_construct(
            **{
                **_DEFAULTS,
                **self.place_m,
                **({} if self.zoom is None else {"zoom": self.zoom}),
                "model": self.name,
                **self.values(vector),
            }
        )

    def aligned(self, vector: F64, camera: CameraCalibration | None = None) -> Alignment:
        """The projection. camera: of the frame, if frames differ."""
        if self.name == "angular":  # as ``resolve``, but 15,000 times in a search
            h, v, cx, cy = self.values(vector).values()
            return Angular(float(np.radians(h)), float(np.radians(v)), cx, cy)
        camera = camera or self.camera
        assert camera is not None
        zoom = {} if self.zoom is None else {"zoom": self.zoom}
        return pinhole(_Mount(**{**self.place_m, **zoom, **self.values(vector)}), camera)

    def spread(self, vectors: F64) -> Mapping[str, float]:
        """Standard deviation of each parameter over (K, P) vectors."""
        rows = [list(self.values(each).values()) for each in vectors]
        return dict(zip(self.unknowns, np.std(rows, axis=0, ddof=1).tolist(), strict=True))

    def grid(self) -> F64:
        """(K, P) vectors of the coarse search."""
        turns = np.arange(-REACH_DEG, REACH_DEG + STEP_DEG / 2, STEP_DEG)
        if self.name == "pinhole":
            lens = [np.arange(-ZOOMS, ZOOMS + 1) * np.log(ZOOM_STEP)] if self.zoom is None else []
            return _product([turns, turns, *[[0.0]] * (len(self.unknowns) - 2 - len(lens)), *lens])
        width, height = self.size
        if self.camera is not None:
            usual = angular_from_calibration(self.camera)
            middle = np.log(np.degrees(usual.h_res_rad))
            half = np.log(ZOOM_REACH)
            zooms = np.arange(middle - half, middle + half + 1e-9, np.log(ZOOM_STEP))
        else:
            narrowest, widest = np.log(np.array(VIEWS_DEG) / width).tolist()
            zooms = np.arange(narrowest, widest, np.log(ZOOM_STEP))
        rows = []
        for zoom in zooms:
            h = float(np.exp(zoom))
            reach_u, reach_v = min(0.4 * width * h, 2.5 * REACH_DEG), min(0.7 * height * h, 1.5 * REACH_DEG)
            step = max(STEP_DEG, 0.015 * width * h)
            us, vs = (np.arange(-reach, reach + step / 2, step) for reach in (reach_u, reach_v))
            rows.append(_product([[zoom], [0.0], us, vs]))
        grid = np.concatenate(rows)
        grid[:, 1] = grid[:, 0]
        return grid

    def bounds(self) -> tuple[F64, F64]:
        """Lower and upper bounds of the refinement."""
        if self.name == "pinhole":
            reaches = {"left_m": FARTHEST_OFF_M, "up_m": FARTHEST_OFF_M, "zoom": np.log(ZOOM_REACH)}
            reach = np.array([reaches.get(name, REACH_DEG) for name in self.unknowns])
            return -reach, reach
        low, high = np.log(np.array([0.005, 0.3]))
        return np.array([low, low, -60.0, -45.0]), np.array([high, high, 60.0, 45.0])


def rounded(values: Mapping[str, float]) -> dict[str, float]:
    """Parameter values with as many digits as mean something."""
    digits = {"h_res_deg": 5, "v_res_deg": 5, "cx_px": 1, "cy_px": 1, "zoom": 4}
    return {name: round(value, digits.get(name, 3)) for name, value in values.items()}


def _product(axes: Sequence[Sequence[float] | F64]) -> F64:
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
