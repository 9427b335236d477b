"""nuScenes: HDL-32E and front camera (Caesar et al. 2020), in the layout of ``v1.0-mini`` and ``v1.0-trainval``.

``samples/`` and ``sweeps/`` hold the sensors' files, ``v1.0-mini/`` the tables. A recording is one scene: 20 s at
20 Hz, labelled at 2 Hz. Ego motion is that of the poses, which come from the car's localisation.

The ego frame has the car's axes and its origin in the LiDAR. A sweep's time is the table's, the end of its rotation.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from pipeline.common.geometry import inverse
from pipeline.common.nearest_in_time import nearest
from pipeline.common.time_range import END_OF_TIME_NS
from pipeline.ego_motion.from_poses import motion_along
from pipeline.formats.file_reading import check_looks_ahead, image_of, image_size, read_bytes, recording_folder
from pipeline.formats.float_points import parse_points
from pipeline.formats.nuscenes_tables import (
    AnnotationRow,
    CalibratedSensorRow,
    CategoryRow,
    EgoPoseRow,
    InstanceRow,
    SampleDataRow,
    SampleRow,
    SceneRow,
    SensorRow,
    intrinsic_of,
    pose_of,
    read_table,
    truth_object,
)
from pipeline.sources.driven_way import DrivenWay
from pipeline.sources.uri_options import split_options
from pipeline.types import F32, F64, U8, CameraCalibration, CameraImage, Frame, Sweep
from pipeline.types.source import Opening, SourceError, TruthObject

_LIDAR, _CAMERA = "LIDAR_TOP", "CAM_FRONT"
_NO_IMAGES = f"no images: no {_CAMERA} files that calibrated_sensor.json knows"
_CHANNELS = 32
_NOMINAL_SIZE = (1600, 900)
_IMAGE_WITHIN_NS = 60_000_000
"""With a camera at 12 Hz, the nearest image is at most 42 ms away."""


def open_recording(uri: str, rest: str, how: Opening) -> NuscenesSource:
    """``nuscenes:DIR?scene=scene-0061&version=v1.0-mini``. Loaded by name from ``pipeline.source_kinds``. SourceError
    if it cannot be opened."""
    return NuscenesSource(uri, rest)


class NuscenesSource:
    """One scene."""

    def __init__(self, uri: str, rest: str) -> None:
        path, options = split_options(rest, ("scene", "version"))
        folder = recording_folder(path)
        tables = _tables(folder, path, options.get("version"))
        scene, others = _scene(tables, options.get("scene"))
        samples = {row.token for row in read_table(tables, "sample", SampleRow) if row.scene_token == scene.token}
        rows = [row for row in read_table(tables, "sample_data", SampleDataRow) if row.sample_token in samples]
        sensors = _sensors(tables)
        self._lidar = _rows_of(rows, _LIDAR, sensors, folder)
        self._images = _rows_of(rows, _CAMERA, sensors, folder)
        if not self._lidar:
            raise SourceError(f"{path}: {scene.name} has no {_LIDAR} files; samples/ or sweeps/ is missing")
        self.uri, self.title, self._folder = uri, scene.name, folder
        mount = _pose_of_sensor(sensors[self._lidar[0].calibrated_sensor_token][0])
        self._T_car_ego = np.eye(4)
        self._T_car_ego[:3, 3] = mount[:3, 3]
        self.T_ego_stored = inverse(self._T_car_ego) @ mount
        self._size = image_size(folder / row.filename for row in self._images[:3]) or _NOMINAL_SIZE
        self._camera = self._calibration(sensors) if self._images else None
        self._ticks = [row.timestamp * 1000 for row in self._lidar]
        self._image_times = np.array([row.timestamp * 1000 for row in self._images], dtype=np.int64)
        self._T_map_ego = self._poses(tables)
        self._own = motion_along(self._ticks, self._T_map_ego)
        self._way = DrivenWay(self._ticks, self._own)
        self._boxes, self._categories = _labels(tables, samples)
        steps = np.diff(self._ticks)
        self.rate_hz = round(1e9 / float(np.median(steps)), 1) if len(steps) and np.median(steps) > 0 else 2.0
        about = [f"{1 + len(others)} scenes; ?scene= opens another: {', '.join(others[:9])}"] if others else []
        self.notes = (*about, *([] if self._images else [_NO_IMAGES]))

    def __len__(self) -> int:
        return len(self._ticks)

    def t_ns(self, index: int) -> int:
        if not 0 <= index < len(self):
            raise IndexError(f"frame {index} of {len(self)}")
        return self._ticks[index]

    def frame(self, index: int) -> Frame:
        notes = list[str]()
        outline = self._outline(index)
        sweep = self._sweep(index, notes)
        image = self._image(outline.t_ns, notes)
        return Frame(index, outline.name, outline.t_ns, sweep, image, self._camera, outline.ego, notes=tuple(notes))

    def outlines(self) -> Iterator[Frame]:
        return (self._outline(index) for index in range(len(self)))

    def sweep(self, index: int) -> Sweep | None:
        self.t_ns(index)
        return self._sweep(index, [])

    def truth(self, index: int) -> tuple[TruthObject, ...] | None:
        self.t_ns(index)
        row = self._lidar[index]
        if not row.is_key_frame or self._categories is None:
            return None
        T_map_ego = self._T_map_ego[index]
        found = [
            truth_object(each, *self._categories.get(each.instance_token, ("object", -1)), T_map_ego)
            for each in self._boxes.get(row.sample_token, ())
        ]
        return self._way.placed(self._ticks[index], [each for each in found if each is not None])

    def _outline(self, index: int) -> Frame:
        t_ns = self.t_ns(index)
        return Frame(index, str(t_ns // 1000), t_ns, camera=self._camera, ego=self._own[index])

    def _sweep(self, index: int, notes: list[str]) -> Sweep | None:
        path = self._folder / self._lidar[index].filename
        try:
            points, ring = parse_sweep(read_bytes(path), path.name, notes)
        except SourceError as error:
            notes.append(str(error))
            return None
        points[:, :3] = points[:, :3] @ self.T_ego_stored[:3, :3].T.astype(np.float32)
        return Sweep(self._ticks[index], points, ring, _CHANNELS)

    def _image(self, t_ns: int, notes: list[str]) -> CameraImage | None:
        if not self._images:
            notes.append(_NO_IMAGES)
            return None
        at = nearest(self._image_times, t_ns, _IMAGE_WITHIN_NS)
        path = self._folder / self._images[at].filename if at is not None else None
        return image_of(path, int(self._image_times[at]) if at is not None else None, self._size, notes)

    def _calibration(self, sensors: dict[str, tuple[CalibratedSensorRow, str]]) -> CameraCalibration:
        sensor, _ = sensors[self._images[0].calibrated_sensor_token]
        T_camera_ego = inverse(_pose_of_sensor(sensor)) @ self._T_car_ego
        road_z_m = -float(self._T_car_ego[2, 3])
        K = intrinsic_of(sensor, f"calibration of {_CAMERA}")
        camera = CameraCalibration(K, np.empty(0), T_camera_ego, *self._size, road_z_m=road_z_m)
        check_looks_ahead(camera, f"calibration of {_CAMERA}")
        return camera

    def _poses(self, tables: Path) -> list[F64]:
        """(4, 4) of every frame, takes ego points to the map."""
        wanted = {row.ego_pose_token for row in self._lidar}
        poses = {row.token: row for row in read_table(tables, "ego_pose", EgoPoseRow) if row.token in wanted}
        if len(poses) < len(wanted):
            raise SourceError(f"{tables.name}/ego_pose.json: {len(wanted) - len(poses)} poses are missing")
        found = (poses[row.ego_pose_token] for row in self._lidar)
        return [pose_of(each.translation, each.rotation, "ego pose") @ self._T_car_ego for each in found]


def parse_sweep(data: bytes, file: str, notes: list[str]) -> tuple[F32, U8]:
    """(N, 4) float32 ``x y z intensity`` (0–255) in the sensor's axes and (N,) uint8 ring of a ``.pcd.bin`` file, as
    ``parse_points`` reads it."""
    rows = parse_points(data, file, 5, 255.0, notes)
    with np.errstate(invalid="ignore"):
        good = (rows[:, 4] >= 0.0) & (rows[:, 4] < _CHANNELS)
    if not np.all(good):
        notes.append(f"{file}: {len(rows) - np.count_nonzero(good)} points without a valid ring skipped")
    if not np.any(good):
        raise SourceError(f"{file}: no LiDAR points")
    return np.ascontiguousarray(rows[good, :4]), rows[good, 4].astype(np.uint8)


def _tables(folder: Path, path: str, version: str | None) -> Path:
    """The folder of the tables."""
    found = sorted(each.parent for each in folder.glob("*/sample_data.json"))
    if version is not None:
        found = [each for each in found if each.name == version]
    if not found:
        named = version or "v1.0-mini"
        raise SourceError(f"{path}: no tables of nuScenes: {named}/sample_data.json is missing")
    return found[0]


def _scene(tables: Path, name: str | None) -> tuple[SceneRow, list[str]]:
    """The scene with this name, else the first one, and the names of the others."""
    scenes = sorted(read_table(tables, "scene", SceneRow), key=lambda scene: scene.name)
    if not scenes:
        raise SourceError(f"{tables.name}/scene.json: no scenes in it")
    names = [scene.name for scene in scenes]
    if name is not None and name not in names:
        raise SourceError(f"scene={name}: no such scene; there are {', '.join(names[:9])}")
    chosen = scenes[names.index(name) if name is not None else 0]
    return chosen, [each for each in names if each != chosen.name]


def _sensors(tables: Path) -> dict[str, tuple[CalibratedSensorRow, str]]:
    """Calibration and channel of every sensor."""
    channels = {row.token: row.channel for row in read_table(tables, "sensor", SensorRow)}
    rows = read_table(tables, "calibrated_sensor", CalibratedSensorRow)
    return {row.token: (row, channels.get(row.sensor_token, "")) for row in rows}


def _rows_of(
    rows: list[SampleDataRow], channel: str, sensors: dict[str, tuple[CalibratedSensorRow, str]], folder: Path
) -> list[SampleDataRow]:
    """The existing files of a sensor, below the data set's folder, in order of time."""
    of_channel = {token for token, (_, name) in sensors.items() if name == channel}
    of_sensor = [
        row for row in rows if row.calibrated_sensor_token in of_channel and 0 < row.timestamp < END_OF_TIME_NS // 1000
    ]
    found = [row for row in of_sensor if _is_below(folder, row.filename)]
    return sorted(found, key=lambda row: row.timestamp)


def _is_below(folder: Path, filename: str) -> bool:
    """Whether a file exists and is inside the data set's folder: a table may name any path."""
    try:
        return ".." not in Path(filename).parts and not Path(filename).is_absolute() and (folder / filename).is_file()
    except (OSError, ValueError):
        return False


def _pose_of_sensor(sensor: CalibratedSensorRow) -> F64:
    return pose_of(sensor.translation, sensor.rotation, "calibrated_sensor.json")


def _labels(
    tables: Path, samples: set[str]
) -> tuple[dict[str, list[AnnotationRow]], dict[str, tuple[str, int]] | None]:
    """Boxes by sample, and category and number by instance; None if the tables contain no labels."""
    if not (tables / "sample_annotation.json").is_file():
        return {}, None
    boxes: dict[str, list[AnnotationRow]] = {}
    for each in read_table(tables, "sample_annotation", AnnotationRow):
        if each.sample_token in samples:
            boxes.setdefault(each.sample_token, []).append(each)
    names = {row.token: row.name for row in read_table(tables, "category", CategoryRow)}
    instances = read_table(tables, "instance", InstanceRow)
    return boxes, {row.token: (names.get(row.category_token, "object"), k) for k, row in enumerate(instances)}
