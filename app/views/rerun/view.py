"""A recording for the rerun viewer: every frame with its result, in one ``.rrd`` file or stream.

The viewer reads only files of its own and of the previous minor version, so this is an export; sessions are the
archive.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path as FilePath
from types import TracebackType
from typing import BinaryIO

import numpy as np
import rerun as rr

from app.views import scene
from app.views.colors import rgb
from app.views.rerun import parts
from app.views.rerun.blueprint import BEV_AHEAD_M, BEV_ASIDE_M, CAMERA, OVERLAYS, blueprint
from app.views.rerun.start_options import PLAYING, RerunStartOptions
from pipeline.alignment import projection
from pipeline.common.errors import BadInput
from pipeline.common.geometry import inverse
from pipeline.params import AlignmentParams
from pipeline.types import Frame, Result

APPLICATION = "CIPV Studio"
_CALIBRATED = AlignmentParams()
_RING_STEP_M = 20.0
_ARROW_S = 1.0
"""Velocity arrows show the object's motion relative to ego in this time."""


class ReplayError(BadInput):
    """The .rrd file cannot be written; the message is one sentence that names the file."""


@dataclass(frozen=True)
class ViewerAddress:
    """Address of a running viewer: ``rerun+http://127.0.0.1:9876/proxy``."""

    url: str
    """As printed by the viewer."""


class RerunSink:
    """Writes each frame and its result to ``target``: a file's path, an open binary stream, which stays open and
    receives the whole recording on closing, or a running viewer.

    ``title`` names the recording in the viewer; ``params`` selects the model that projects the points into the image.
    Timelines: ``frame`` (index) and ``sensor_time`` (the frame's tick), never the time of writing. ReplayError if the
    file cannot be created. Use it in a ``with`` block: a recording is complete once closed. One thread at a time.
    """

    def __init__(
        self,
        target: str | FilePath | BinaryIO | ViewerAddress,
        title: str = APPLICATION,
        params: AlignmentParams = _CALIBRATED,
        opening: RerunStartOptions = PLAYING,
    ) -> None:
        self._params = params
        self._rec = rr.RecordingStream(APPLICATION, send_properties=False)
        self._rec.send_recording_name(title)
        rr.set_log_time_enabled(False, recording=self._rec)
        rr.set_log_tick_enabled(False, recording=self._rec)
        self._stream: BinaryIO | None = None
        self._buffer: rr.BinaryStream | None = None
        if isinstance(target, str | FilePath):
            self._open_file(FilePath(target))
        elif isinstance(target, ViewerAddress):
            self._connect(target)
        else:
            self._stream, self._buffer = target, rr.binary_stream(self._rec)
        self._rec.send_blueprint(blueprint(opening))
        self._log_static()

    def _open_file(self, path: FilePath) -> None:
        try:
            self._rec.save(path)
        except RuntimeError as error:
            raise ReplayError(f"{path}: cannot write the rerun file: {_cause(error)}") from None

    def _connect(self, viewer: ViewerAddress) -> None:
        try:
            self._rec.connect_grpc(viewer.url)
        except (RuntimeError, ValueError) as error:
            raise ReplayError(f"{viewer.url}: not the address of a rerun viewer: {error}") from None

    def show(self, frame: Frame, result: Result) -> None:
        """Add one frame."""
        self._rec.set_time("frame", sequence=frame.index)
        self._rec.set_time("sensor_time", timestamp=np.datetime64(frame.t_ns, "ns"))
        self._log_world(result)
        self._log_camera(frame, result)
        self._log_bev(result)
        self._log_curves(result)
        self._log_reasons(result)

    def flush(self, timeout_s: float) -> bool:
        """Wait until everything shown is written or sent; false on timeout, for example because the viewer has
        disconnected."""
        try:
            self._rec.flush(timeout_sec=timeout_s)
        except (RuntimeError, ValueError):
            return False
        return True

    def abandon(self) -> None:
        """Close without waiting for a viewer that does not respond."""
        self._rec.disconnect()

    def close(self) -> None:
        """Write what is buffered and finish the file. Closing twice is allowed."""
        self._rec.flush()
        if self._stream is not None and self._buffer is not None:
            self._stream.write(self._buffer.read() or b"")
            self._stream = None
        self._rec.disconnect()

    def __enter__(self) -> RerunSink:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _put(self, entity: str, what: rr.AsComponents | None) -> None:
        """Log an entity, or clear it if there is nothing to show."""
        self._rec.log(entity, rr.Clear(recursive=False) if what is None else what)

    # ------------------------------------------------------------ static content

    def _log_static(self) -> None:
        self._rec.log("world", rr.ViewCoordinates.FLU, static=True)
        rings = np.arange(_RING_STEP_M, BEV_AHEAD_M + 1.0, _RING_STEP_M)
        angle = np.linspace(-np.pi / 2, np.pi / 2, 61)
        arcs = [parts.to_bev(np.column_stack([r * np.cos(angle), r * np.sin(angle)])) for r in rings]
        self._rec.log("bev/rings", rr.LineStrips2D(arcs, colors=rgb("grid"), radii=parts.THIN), static=True)
        places = [(0.0, -r) for r in rings]
        texts = [f"{r:.0f} m" for r in rings]
        marks = rr.Points2D(places, labels=texts, colors=rgb("ground"), radii=parts.THIN, show_labels=True)
        self._rec.log("bev/rings/labels", marks, static=True)
        ego = parts.to_bev(scene.ego_cuboid(0.0).footprint())
        self._rec.log(
            "bev/ego",
            rr.LineStrips2D([parts.closed(ego)], colors=rgb("ego"), radii=parts.THIN),
            static=True,
        )
        for name, role in (("distance", "cipv"), ("closing_speed", "warning"), ("ttc", "lidar")):
            line = rr.SeriesLines(colors=rgb(role), names=name, widths=2.0)  # type: ignore[arg-type]
            self._rec.log(f"curves/{name}/cipv", line, static=True)

    # ------------------------------------------------------------ one frame

    def _log_world(self, result: Result) -> None:
        ground_m = scene.ground_height_m(result) or 0.0
        points = result.layers.points
        cloud = (
            rr.Points3D(points[:, :3], colors=scene.point_colors(result), radii=parts.POINT) if len(points) else None
        )
        self._put("world/points", cloud)
        others = [each for each in result.objects if each.cuboid is not None and each.id != scene.cipv_id(result)]
        self._put("world/cuboids", parts.cuboids(others, result, rr.components.FillMode.MajorWireframe))
        lead = [each for each in result.objects if each.cuboid is not None and each.id == scene.cipv_id(result)]
        self._put("world/cipv", parts.cuboids(lead, result, rr.components.FillMode.TransparentFillMajorWireframe))
        flat = [each for each in result.objects if each.cuboid is None and each.bev is not None]
        self._put("world/footprints", parts.footprints(flat, result, ground_m))
        named = [each for each in result.objects if each.bev is not None and scene.stands_out(each, result)]
        self._put("world/labels", parts.labels(named, result, ground_m))
        for side, line in parts.sides(result.path).items():
            strip = rr.LineStrips3D([scene.on_ground(line, ground_m + 0.05)], colors=rgb("path"), radii=parts.THIN)
            self._put(f"world/path/{side}", strip)
        lanes = [scene.on_ground(line, ground_m + 0.06) for line in scene.lane_lines(result) if len(line) > 1]
        strips = rr.LineStrips3D(lanes, colors=rgb("lane"), radii=parts.THICK) if lanes else None
        self._put("world/path/lanes", strips)
        ego = scene.ego_cuboid(ground_m)
        box = rr.Boxes3D(centers=[ego.center], sizes=[ego.size], colors=rgb("ego"), radii=parts.THIN, fill_mode="solid")
        self._put("world/ego", box)

    def _log_camera(self, frame: Frame, result: Result) -> None:
        if frame.camera is not None:
            T_ego_camera = inverse(frame.camera.T_camera_ego)
            self._rec.log(CAMERA, rr.Transform3D(translation=T_ego_camera[:3, 3], mat3x3=T_ego_camera[:3, :3]))
            lens = rr.Pinhole(
                image_from_camera=frame.camera.K,
                resolution=(frame.camera.width, frame.camera.height),
                camera_xyz=rr.ViewCoordinates.RDF,
                image_plane_distance=3.0,
            )
            self._rec.log(CAMERA, lens)
        self._put(f"{CAMERA}/image", None if frame.image is None else parts.encoded(frame.image))
        self._put(f"{OVERLAYS}/points", self._projected(frame, result))
        layers = result.layers
        lidar_colors = {number: rgb("lidar") for number in layers.lidar_boxes}
        vision_colors = {number: rgb("vision") for number in layers.vision_boxes}
        seen = {each.id: scene.object_text(each) for each in result.objects if scene.stands_out(each, result)}
        now = {number: box for number, box in layers.vision_boxes.items() if number in seen}
        carried = {number: box for number, box in layers.vision_boxes.items() if number not in seen}
        self._put(f"{OVERLAYS}/lidar_boxes", parts.boxes(layers.lidar_boxes, lidar_colors, {}, parts.THIN))
        self._put(f"{OVERLAYS}/vision_boxes", parts.boxes(now, vision_colors, seen, parts.THIN))
        self._put(f"{OVERLAYS}/carried_boxes", parts.boxes(carried, vision_colors, {}, parts.FAINT))
        number = scene.cipv_id(result)
        box = layers.vision_boxes.get(number, layers.lidar_boxes.get(number)) if number is not None else None
        lead = {} if number is None or box is None else {number: box}
        self._put(f"{OVERLAYS}/cipv", parts.boxes(lead, {each: rgb("cipv") for each in lead}, {}, parts.THICK))

    def _projected(self, frame: Frame, result: Result) -> rr.Points2D | None:
        model = projection.resolve(self._params, frame.camera)
        points = result.layers.points
        if model is None or frame.image is None or not len(points):
            return None
        height, width = frame.image.bgr.shape[:2]
        pixels = model.project(points[:, :3].astype(np.float64))
        with np.errstate(invalid="ignore"):
            inside = np.all((pixels >= 0) & (pixels < [width, height]), axis=1)
        range_m = np.hypot(points[inside, 0], points[inside, 1])
        return rr.Points2D(pixels[inside], colors=scene.range_colors(range_m), radii=parts.POINT)

    def _log_bev(self, result: Result) -> None:
        placed = [each for each in result.objects if each.bev is not None]
        colors = [scene.object_color(each, result) for each in placed]
        rings = [parts.closed(parts.to_bev(np.asarray(each.bev))) for each in placed]
        self._put("bev/footprints", rr.LineStrips2D(rings, colors=colors, radii=parts.THICK) if placed else None)
        named = [each for each in placed if scene.stands_out(each, result)]
        self._put("bev/labels", parts.bev_labels(named, result))
        moving = [each for each in named if each.velocity_mps is not None]
        starts = [parts.to_bev(np.asarray(each.bev)).mean(axis=0) for each in moving]
        steps = [parts.to_bev(np.asarray([each.velocity_mps]))[0] * _ARROW_S for each in moving]
        arrows = [scene.object_color(each, result) for each in moving]
        self._put("bev/velocity", rr.Arrows2D(origins=starts, vectors=steps, colors=arrows) if moving else None)
        for side, line in parts.sides(result.path).items():
            near = line[np.abs(line[:, 1]) <= BEV_ASIDE_M]
            self._put(
                f"bev/path/{side}",
                rr.LineStrips2D([parts.to_bev(near)], colors=rgb("path"), radii=parts.THIN),
            )

    def _log_curves(self, result: Result) -> None:
        cipv, acc, ego = result.cipv, result.acc, result.ego
        self._scalar("distance/cipv", None if cipv is None else cipv.distance_m)
        self._scalar("closing_speed/cipv", None if cipv is None else cipv.closing_speed_mps)
        self._scalar("ttc/cipv", None if cipv is None else cipv.ttc_s)
        self._scalar("speed/desired", None if acc is None else acc.desired_speed_mps * 3.6)
        self._scalar("speed/ego", None if ego is None else ego.speed_mps * 3.6)
        for stage, value in result.timing_ms.items():
            self._scalar(f"timing/{stage}", value)

    def _scalar(self, name: str, value: float | None) -> None:
        """None interrupts the curve, so that no unmeasured value is drawn."""
        self._put(f"curves/{name}", None if value is None else rr.Scalars(value))

    def _log_reasons(self, result: Result) -> None:
        reason = "no vehicle in path" if result.cipv is None else f"CIPV #{result.cipv.id}: {result.cipv.reason}"
        self._rec.log("reasons/cipv", rr.TextLog(reason, level=rr.TextLogLevel.INFO))
        if result.acc is not None:
            self._rec.log(
                "reasons/acc", rr.TextLog(f"{result.acc.state}: {result.acc.reason}", level=rr.TextLogLevel.INFO)
            )
        for each in result.rejected:
            self._rec.log("reasons/rejected", rr.TextLog(f"#{each.id}: {each.reason}", level=rr.TextLogLevel.DEBUG))
        for note in result.notes:
            self._rec.log("reasons/notes", rr.TextLog(note, level=rr.TextLogLevel.WARN))


def _cause(error: RuntimeError) -> str:
    """The operating system's message, extracted from the library's message."""
    return str(error).removeprefix("Failed to create file: ").partition(" (os error")[0].lower()
