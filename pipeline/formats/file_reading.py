"""Shared functions for recordings stored as folders of files: listing, reading, decoding and calibration checks."""

from __future__ import annotations

import re
from collections.abc import Iterable
from decimal import Decimal
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pipeline.common.files.image_decoding import TooMuch, decode_within_budget
from pipeline.common.files.user_file_errors import given_path, reason_of
from pipeline.common.files.user_files import check_allowed, read_regular
from pipeline.common.geometry import inverse
from pipeline.formats.extrinsic_mistakes import likely_mistake, looks_ahead
from pipeline.types import F64, U8, CameraCalibration, CameraImage
from pipeline.types.source import SourceError

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg")
"""Of the images in a folder."""
_JPEG_START = b"\xff\xd8"
_MARKERS = ((_JPEG_START, b"\xff\xd9"), (b"\x89PNG", b"IEND"))
_LARGEST_FILE_BYTES = 512 << 20
"""Limit for one frame: the largest sweeps have a few dozen MB."""
_END_BYTES = 64
_NUMBER = re.compile(r"\d+(\.\d+)?")


def recording_folder(path: str) -> Path:
    """The folder given by the user, with ``~`` resolved. SourceError if it is not a folder, or empty."""
    if not path:
        raise SourceError("no folder given after the colon")
    try:
        folder = given_path(path, SourceError)
        check_allowed(folder)
        if not folder.exists():
            raise SourceError(f"{path}: no such folder")
        if not folder.is_dir():
            raise SourceError(f"{path}: not a folder")
        if not any(folder.iterdir()):
            raise SourceError(f"{path}: the folder is empty")
    except (OSError, RuntimeError, ValueError) as error:
        raise SourceError(f"{path}: cannot be opened: {reason_of(error)}") from None
    return folder


def recording_file(path: str) -> Path:
    """The file given by the user, with ``~`` resolved. SourceError if it does not exist."""
    if not path:
        raise SourceError("no file given after the colon")
    try:
        file = given_path(path, SourceError)
        check_allowed(file)
        if not file.exists():
            raise SourceError(f"{path}: no such file")
        if not file.is_file():
            raise SourceError(f"{path}: {'a folder, not a file' if file.is_dir() else 'not a file'}")
    except (OSError, RuntimeError, ValueError) as error:
        raise SourceError(f"{path}: cannot be opened: {reason_of(error)}") from None
    return file


def files_by_name(folder: Path, suffixes: tuple[str, ...]) -> dict[str, Path]:
    """Files of a folder by their name without suffix, which may have two parts (``.ubx.txt``), ``in_order``; empty if
    there is no such folder."""
    found: dict[str, Path] = {}
    try:
        for path in sorted(folder.iterdir()):
            suffix = next((each for each in suffixes if path.name.lower().endswith(each)), path.name)
            if len(suffix) < len(path.name):
                found[path.name[: -len(suffix)]] = path
    except OSError:
        return {}
    return {name: found[name] for name in in_order(found)}


def in_order(names: Iterable[str]) -> list[str]:
    """Names of frames, sorted by number if all of them are numbers (``2`` before ``10``), else alphabetically."""
    by_letter = sorted(names)
    return sorted(by_letter, key=Decimal) if all(map(_NUMBER.fullmatch, by_letter)) else by_letter


def read_bytes(path: Path) -> bytes:
    """The whole file. SourceError names it when it cannot be read."""
    try:
        return read_regular(path, _LARGEST_FILE_BYTES)
    except OSError as error:
        raise SourceError(f"{path.name}: cannot be read: {reason_of(error)}") from None


def read_image(path: Path) -> tuple[U8, bytes | None]:
    """``decode_image`` for a file. SourceError also if it cannot be read."""
    return decode_image(read_bytes(path), path.name)


def image_size(paths: Iterable[Path]) -> tuple[int, int] | None:
    """Width and height of the first readable image; None where there is none."""
    for path in paths:
        try:
            bgr, _ = read_image(path)
        except SourceError:
            continue
        return bgr.shape[1], bgr.shape[0]
    return None


def decode_image(data: bytes, name: str) -> tuple[U8, bytes | None]:
    """(H, W, 3) uint8 blue green red, and the data itself if it is a JPEG. SourceError if it is not a complete image.

    A JPEG or PNG without its end marker is refused: its lower part would be a flat grey that a detector mistakes for
    road.
    """
    is_jpeg = data.startswith(_JPEG_START)
    for start, end in _MARKERS:
        if data.startswith(start) and end not in data[-_END_BYTES:]:
            raise SourceError(f"{name}: the image is truncated")
    try:
        image = decode_within_budget(data)
    except TooMuch as error:
        raise SourceError(f"{name}: not a readable image: {error}") from None
    if image is None:
        raise SourceError(f"{name}: not a readable image")
    return image, data if is_jpeg else None


def image_of(path: Path | None, t_ns: int | None, size: tuple[int, int], notes: list[str]) -> CameraImage | None:
    """The image of a frame; None, with the reason in ``notes``, if there is no file, it is damaged, or its size (width,
    height) differs from that of the recording's other images."""
    if path is None:
        notes.append("no image for this frame")
        return None
    try:
        bgr, encoded = read_image(path)
    except SourceError as error:
        notes.append(str(error))
        return None
    if (bgr.shape[1], bgr.shape[0]) != size:
        notes.append(f"{path.name}: {bgr.shape[1]}×{bgr.shape[0]}, the others are {size[0]}×{size[1]}")
        return None
    return CameraImage(t_ns, bgr, encoded)


def rigid_transform(values: npt.ArrayLike, what: str) -> F64:
    """(4, 4) float64 from a (3, 4) or (4, 4) rigid transform. SourceError "… is not a rigid transform" for anything
    else: a wrong shape, not finite, a scaled or mirrored rotation, a last row other than 0 0 0 1."""
    try:
        given = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        given = np.empty(0)
    T = np.eye(4)
    if given.shape in ((3, 4), (4, 4)) and bool(np.all(np.isfinite(given))) and float(np.abs(given).max()) < 1e6:
        T[: given.shape[0]] = given
        R = T[:3, :3]
        orthonormal = np.allclose(R @ R.T, np.eye(3), atol=1e-3) and float(np.linalg.det(R)) > 0.0
        if orthonormal and np.allclose(T[3], [0.0, 0.0, 0.0, 1.0]):
            return T
    raise SourceError(f"{what} is not a rigid transform")


def camera_matrix(values: npt.ArrayLike, what: str) -> F64:
    """(3, 3) float64 pinhole matrix. SourceError unless focal lengths are positive, what is below the diagonal is zero
    and the last element one."""
    try:
        K = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        K = np.empty(0)
    if (
        K.shape == (3, 3)
        and bool(np.all(np.isfinite(K)))
        and float(np.abs(K).max()) < 1e6
        and min(K[0, 0], K[1, 1]) > 1.0
        and np.allclose(np.tril(K, -1), 0.0)
        and np.isclose(K[2, 2], 1.0)
    ):
        return K
    raise SourceError(f"{what} is not a camera matrix")


def check_looks_ahead(camera: CameraCalibration, what: str, T_ego_lidar: F64 | None = None) -> None:
    """SourceError unless ego +x falls inside the image widened by half its size on every side. T_ego_lidar: (4, 4), for
    a calibration whose extrinsic takes points of the LiDAR's own frame, which is not the ego frame.

    A front camera sees where the car drives. With the usual mistake, an inverted extrinsic, ego +x is far to the side
    or behind; the text names the mistake if undoing it helps.
    """
    size = camera.width, camera.height
    T_lidar_ego = np.eye(4) if T_ego_lidar is None else inverse(T_ego_lidar)
    if not looks_ahead(camera.K, camera.T_camera_ego @ T_lidar_ego, size):
        mistake = likely_mistake(camera.K, camera.T_camera_ego, T_lidar_ego, size)
        raise SourceError(f"{what}: the camera does not look ahead; {mistake}")
