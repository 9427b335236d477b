"""A camera calibration of another tool as alignment parameters: the difference from the recording's calibration, or
the angular model that comes nearest to it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from pipeline.alignment.convert import angular_of, angular_values, costs
from pipeline.alignment.projection import Pinhole, corrected
from pipeline.calibration.alignment.models import FARTHEST_OFF_M, PLACE, REACH_DEG, ZOOM_REACH
from pipeline.common.errors import BadInput
from pipeline.common.geometry import inverse
from pipeline.params import AlignmentParams
from pipeline.types import F64, CameraCalibration

SAME_LENS_PX = 1.0
"""Two lenses whose pixels differ by no more are the same: a depth edge is located to about a pixel."""
TURNED_DEG, SHIFTED_M = 3.0, 0.3
"""A mount that is turned or shifted by more than this is probably that of another camera or of another set-up: what is
knocked or calibrated anew moves by less, and the score of an alignment covers 3°."""
_GRID = 9


class ImportRefused(BadInput):
    """A calibration that cannot be used for the recording; the text gives the reason."""


@dataclass(frozen=True)
class ImportedAlignment:
    """What a calibration changes."""

    values: Mapping[str, float | str]
    """Of ``AlignmentParams``, by name."""
    text: str
    """What it is, as a sentence."""
    warnings: tuple[str, ...]
    """What is not as in the file."""


def imported(
    given: CameraCalibration,
    present: AlignmentParams,
    camera: CameraCalibration | None,
    size: tuple[int, int],
    T_ego_lidar: F64 | None = None,
) -> ImportedAlignment:
    """Parameters of the present model.

    given: the calibration, whose ego frame is the LiDAR's own. camera: the recording's, of which the pinhole model
    keeps the lens, apart from the focal length. size: width and height of the recording's images. T_ego_lidar: (4, 4),
    the LiDAR's mount; None where the ego frame is its own. ImportRefused for another image size or a mount that is far
    from the recording's.
    """
    if (given.width, given.height) != size:
        raise ImportRefused(
            f"the calibration is for images of {given.width}×{given.height}, the recording's are {size[0]}×{size[1]}"
        )
    if T_ego_lidar is not None:
        given = replace(given, T_camera_ego=given.T_camera_ego @ inverse(T_ego_lidar))
    if present.model == "angular" or camera is None:
        return _angular(given)
    turn_deg, shift_m = correction(camera, given)
    for name, value, most, unit in (
        *((name, value, REACH_DEG, "°") for name, value in turn_deg.items()),
        *((name, value, FARTHEST_OFF_M, " m") for name, value in shift_m.items()),
    ):
        if abs(value) > most:
            raise ImportRefused(
                f"the mount differs from the recording's by {value:+.1f}{unit} in {name.rpartition('_')[0]}, more than "
                f"{most:.0f}{unit}: is it the calibration of this camera and this LiDAR?"
            )
    zoom, warnings = _zoom(given, camera)
    far = max(map(abs, turn_deg.values())), max(map(abs, shift_m.values()))
    if far[0] > TURNED_DEG or far[1] > SHIFTED_M:
        warnings += (
            f"the mount differs from the recording's by {far[0]:.1f}° and {far[1]:.2f} m: is the file from this rig?",
        )
    values = {name: round(value, 4) for name, value in (*turn_deg.items(), *shift_m.items())}
    what = "Mount" if zoom == 1.0 else "Mount and focal length"
    text = f"{what} of the file, as a correction of the recording's calibration"
    return ImportedAlignment({"model": "pinhole", "zoom": zoom, **values}, text, warnings)


def correction(camera: CameraCalibration, wanted: CameraCalibration) -> tuple[dict[str, float], dict[str, float]]:
    """The parameters, in degrees and in metres, with which ``corrected`` gives a calibration the mount of another."""
    here, there = inverse(camera.T_camera_ego), inverse(wanted.T_camera_ego)
    turn = there[:3, :3] @ here[:3, :3].T
    roll, pitch, yaw = np.degrees(
        [np.arctan2(turn[2, 1], turn[2, 2]), np.arcsin(np.clip(-turn[2, 0], -1, 1)), np.arctan2(turn[1, 0], turn[0, 0])]
    ).tolist()
    shift = (there[:3, 3] - here[:3, 3]).tolist()
    return {"yaw_deg": yaw, "pitch_deg": pitch, "roll_deg": roll}, dict(zip(PLACE, shift, strict=True))


def _angular(given: CameraCalibration) -> ImportedAlignment:
    exact = Pinhole(given.K, given.distortion, given.T_camera_ego)
    found = angular_of(exact, given)
    parts = [
        f"{each.mean_px:.0f} px at {each.from_deg:.0f}–{each.to_deg:.0f}°"
        for each in costs(exact, found, given.width, given.height, given.road_z_m)
    ]
    text = f"The angular model that comes nearest to the file, off by {', '.join(parts)}"
    return ImportedAlignment(angular_values(found), text, ())


def _zoom(given: CameraCalibration, camera: CameraCalibration) -> tuple[float, tuple[str, ...]]:
    """The factor on the focal length that makes the recording's lens that of the file, and no warning; 1 and what is
    wrong if none does."""
    zoom = round(float(given.K[0, 0] / camera.K[0, 0]), 4)
    scaled = corrected(AlignmentParams.model_construct(**{**AlignmentParams().model_dump(), "zoom": zoom}), camera)
    if 1.0 / ZOOM_REACH <= zoom <= ZOOM_REACH and not _lens_warnings(given, scaled):
        return zoom if _lens_warnings(given, camera) else 1.0, ()
    return 1.0, _lens_warnings(given, camera)


def _lens_warnings(given: CameraCalibration, camera: CameraCalibration) -> tuple[str, ...]:
    """Whether the lenses differ, of which only the recording's is used."""
    u, v = np.meshgrid(np.linspace(0, camera.width - 1, _GRID), np.linspace(0, camera.height - 1, _GRID))
    pixels, still = np.column_stack([u.ravel(), v.ravel()]), np.eye(4)
    _, rays = Pinhole(camera.K, camera.distortion, still).rays(pixels)
    off_px = np.hypot(*(Pinhole(given.K, given.distortion, still).project(rays) - pixels).T)
    if np.nanmax(off_px) <= SAME_LENS_PX:
        return ()
    raw = [bool(np.any(each.distortion)) for each in (given, camera)]
    kinds = {True: "raw images, with distortion", False: "undistorted images"}
    cause = f": the file is for {kinds[raw[0]]}, the recording for {kinds[raw[1]]}" if raw[0] != raw[1] else ""
    return (
        f"the lens in the file differs from the recording's by up to {np.nanmax(off_px):.0f} px{cause}; only the mount "
        "is imported",
    )
