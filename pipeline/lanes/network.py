"""A lane network in an ONNX file as one function: image in, points on painted lines and on the edges of
the drivable area out.

The paper uses ENet-SAD; any network whose outputs ``pipeline.lanes.heads`` supports will do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import cv2
import numpy as np
import onnx
import onnxruntime as ort

from pipeline.common.files.data_dir import file_sha256
from pipeline.inference.graph import Size, input_size, with_empty_masks, with_input_size, with_rows
from pipeline.inference.runtime import (
    DetectorError,
    DetectorMissing,
    check_image,
    find_graph,
    open_session,
    read_graph,
    run_session,
)
from pipeline.inference.tuning import USUAL_THREADS
from pipeline.inference.used_files import file_notes
from pipeline.lanes.far_window import far_window, window_outline
from pipeline.lanes.heads import LaneHead, UnknownLaneHead, pick_head
from pipeline.lanes.horizon import ImageOutline, image_outline
from pipeline.types import F32, U8, CameraCalibration, PixelWindow, RawLanes

_FREE_SIZE: Size = (360, 640)
"""Input (height, width) for a graph with free size: that of the BDD100K networks."""
_PADDING = 114
_MIN_SCORE = 0.3
_GREY = 0.45
_ROW_STEP, _FEWEST_ROWS = 8, 64
"""The rows of a smaller input are a multiple of the network's coarsest stride. With fewer than 88, the number for
Astyx, nothing was measured."""
_MOST_SKY = 0.6
"""At most this share of an image is cut off as sky, whatever its calibration says."""
_CUT_PX = 3.0
"""Points this close to an inner edge of the window are where it was cut, not where the road ends."""


@dataclass(frozen=True)
class LaneNetwork:
    """A loaded lane network."""

    path: Path
    """The ONNX file."""
    name: str
    """File and digest; equal names give equal points, so this is used as cache key."""
    providers: tuple[str, ...]
    """ONNX Runtime's execution providers in use."""
    input_size: Size
    """Height, width in pixels."""
    head: LaneHead
    """How its outputs are decoded."""
    notes: tuple[str, ...]
    """Notes for the user, added to every result."""
    threads: int
    """Number of threads per image."""
    outline: ImageOutline
    """Of the camera's images, or of the window."""
    sha256: str
    """Of the file."""
    _session: ort.InferenceSession = field(repr=False, compare=False)
    window: PixelWindow | None = None
    """The only part of the images that it processes; None for the whole image."""

    def detect(self, bgr: U8) -> RawLanes:
        """Points on lines and on the road's edges in an image (H, W, 3) uint8, in its pixels.

        DetectorError for an array that is not such an image, or if the network fails on it.
        """
        check_image(bgr)
        if self.window is not None:
            return self._in_window(bgr, self.window)
        placed = _placed((bgr.shape[0], bgr.shape[1]), self.input_size, self.head, self.outline.horizon)
        found = self.head.points(run_session(self._session, self._blob(bgr, placed)))
        keep = found.score >= _MIN_SCORE
        uv = found.uv[keep] * (self.input_size[1], self.input_size[0])
        uv = (uv - placed.shift) / placed.scale + (0.0, placed.top) - 0.5  # integers are pixel centres
        inside = np.all((uv >= 0.0) & (uv <= (bgr.shape[1] - 1, bgr.shape[0] - 1)), axis=1)
        return RawLanes(self.name, uv[inside].astype(np.float32), found.score[keep][inside], found.line[keep][inside])

    def of_camera(self, camera: CameraCalibration | None) -> LaneNetwork:
        """The same network for images of another camera; None if it is not known. It is loaded again only if the size
        of its input depends on the camera."""
        return self._seeing(image_outline(camera), None)

    def far_of(self, camera: CameraCalibration | None) -> LaneNetwork | None:
        """The same network for the far part of a camera's images (``far_window``). None if that would show no more than
        the whole image."""
        window = far_window(camera) if camera is not None and self.head.keeps_aspect else None
        return self._seeing(window_outline(camera, window), window) if camera is not None and window else None

    def _seeing(self, outline: ImageOutline, window: PixelWindow | None) -> LaneNetwork:
        if self.head.keeps_aspect and outline != self.outline:
            return load_lane_network(self.path, self.threads, outline, window)
        name = _name(self.path, self.sha256, self.head, outline, window)
        return replace(self, name=name, outline=outline, window=window)

    def _in_window(self, bgr: U8, window: PixelWindow) -> RawLanes:
        """The same for the part of an image in the window; none if the image is smaller than the camera's."""
        x1, y1, x2, y2 = window
        if bgr.shape[1] < x2 or bgr.shape[0] < y2:
            none = np.zeros((0, 2), np.float32)
            return RawLanes(self.name, none, np.zeros(0, np.float32), np.zeros(0, np.int32), window=window)
        seen = replace(self, window=None).detect(np.ascontiguousarray(bgr[y1:y2, x1:x2]))
        u = seen.points[:, 0]
        left, right = (u > _CUT_PX) | (x1 == 0), (u < x2 - x1 - 1 - _CUT_PX) | (x2 == bgr.shape[1])
        return replace(seen, points=seen.points + np.array([x1, y1], np.float32), window=window).only(left & right)

    def _blob(self, bgr: U8, placed: _Placed) -> F32:
        """(1, 3, h, w) float32, the network's input."""
        height, width = placed.size
        resized = cv2.resize(bgr[placed.top :], (width, height), interpolation=cv2.INTER_LINEAR)
        if (height, width) != self.input_size:
            x, y = placed.shift
            filled = np.full((*self.input_size, 3), _PADDING, np.uint8)
            filled[int(y) : int(y) + height, int(x) : int(x) + width] = resized
            resized = filled
        blob = np.asarray(cv2.dnn.blobFromImage(resized, scalefactor=1.0 / 255.0, swapRB=True), np.float32)
        mean, spread = (np.array(each, np.float32).reshape(1, 3, 1, 1) for each in (self.head.mean, self.head.spread))
        return np.asarray((blob - mean) / spread, np.float32)


@dataclass(frozen=True)
class _Placed:
    """Placement of an image in the input: its rows from ``top`` on, scaled by (x, y), with its corner at ``shift`` (x,
    y)."""

    top: int
    size: Size
    scale: tuple[float, float]
    shift: tuple[float, float]


def open_lane_network(
    spec: str | None, threads: int = USUAL_THREADS, camera: CameraCalibration | None = None
) -> LaneNetwork:
    """Load a lane network by name or path; None: the default one (``pipeline.inference.model_registry``). camera:
    camera of the images; None if it is not known.

    DetectorMissing if there is no file, DetectorError if the file is not a lane network that can be run.
    """
    path = find_graph(spec, "lanes")
    if path is None:
        what = f"No lane network {spec!r}" if spec else "No lane network is installed"
        raise DetectorMissing(
            f"{what}: run `cipv models pull twinlitenet`, or give an ONNX file with `--lanes PATH`, "
            "or use `--lanes classical`, which needs none."
        )
    return load_lane_network(path, threads, image_outline(camera))


def load_lane_network(
    path: Path, threads: int, outline: ImageOutline, window: PixelWindow | None = None
) -> LaneNetwork:
    """The network in a file, tested by running it on a grey image. outline: of the camera's images, or of the window in
    them that it is to process. DetectorError if it is not a lane network that can be run."""
    model = with_empty_masks(read_graph(path))
    try:
        own = input_size(model)
    except ValueError as error:
        raise DetectorError(f"{path.name} is not a lane network: {error}") from None
    size = own or _FREE_SIZE
    try:
        model = model if own else with_input_size(model, size)
    except ValueError as error:
        raise DetectorError(f"{path.name} cannot be run: {error}") from None
    session = open_session(model.SerializeToString(), path, threads)
    try:
        head = pick_head(_probe(session, size), [output.name for output in session.get_outputs()])
    except UnknownLaneHead as error:
        raise DetectorError(f"{path.name}: {error}") from None
    if head.keeps_aspect:
        rows = _rows(size, head, outline)
        smaller = _with_rows(model, rows, head, path, threads)
        head = head if smaller is not None else replace(head, horizon=None, keeps_aspect=False)
        session, size = (smaller, (rows, size[1])) if smaller is not None else (session, size)
    sha256 = file_sha256(path)
    name = _name(path, sha256, head, outline, window)
    notes = (f"Lane lines by the network {path.stem}", *file_notes(path, sha256))
    count = session.get_session_options().intra_op_num_threads
    providers = tuple(session.get_providers())
    return LaneNetwork(path, name, providers, size, head, notes, count, outline, sha256, session, window)


def _probe(session: ort.InferenceSession, size: Size) -> Sequence[F32]:
    """Outputs for a grey image of this size."""
    return run_session(session, np.full((1, 3, *size), _GREY, np.float32))


def _rows(size: Size, head: LaneHead, outline: ImageOutline) -> int:
    """Rows of an input that shows the road in its own aspect: at most those of ``size``."""
    rows = size[1] * outline.aspect * (1.0 - _sky(head, outline.horizon))
    return min(size[0], max(_FEWEST_ROWS, round(rows / _ROW_STEP) * _ROW_STEP))


def _with_rows(
    model: onnx.ModelProto, rows: int, head: LaneHead, path: Path, threads: int
) -> ort.InferenceSession | None:
    """The network with as many rows; None if its graph cannot be changed so, for example because its attention has
    windows of a fixed size."""
    try:
        session = open_session(with_rows(model, rows).SerializeToString(), path, threads)
        columns = input_size(model)
        mask = _probe(session, (rows, columns[1] if columns else rows))[head.output]
    except (DetectorError, ValueError):
        return None
    return session if mask.shape[-2] == rows else None


def _name(path: Path, sha256: str, head: LaneHead, outline: ImageOutline, window: PixelWindow | None) -> str:
    """Of a network. What its input depends on is part of it."""
    name = f"{path.stem}-{sha256[:12]}" + ("-road" if head.road is not None else "")
    if head.horizon is not None:
        aspect = f"-{outline.aspect:.3f}" if head.keeps_aspect else ""
        name = f"{name}-{outline.horizon:.3f}{aspect}"
    return name if window is None else f"{name}-far{'.'.join(map(str, window))}"


def _placed(image: Size, size: Size, head: LaneHead, horizon: float) -> _Placed:
    (height, width), (rows, columns) = image, size
    if head.fit == "letterbox":
        scale = min(rows / height, columns / width)
        fitted = (max(1, round(height * scale)), max(1, round(width * scale)))
        shift = (float((columns - fitted[1]) // 2), float((rows - fitted[0]) // 2))
        return _Placed(0, fitted, (fitted[1] / width, fitted[0] / height), shift)
    top = max(0, height - round(width * rows / columns)) if head.fit == "lower" else 0
    if head.horizon is not None:
        top = round(_sky(head, horizon) * height)
    return _Placed(top, size, (columns / width, rows / (height - top)), (0.0, 0.0))


def _sky(head: LaneHead, horizon: float) -> float:
    """Share of an image's rows that is cut off, so that its horizon is where the network expects it."""
    if head.horizon is None:
        return 0.0
    return min(max((horizon - head.horizon) / (1.0 - head.horizon), 0.0), _MOST_SKY)
