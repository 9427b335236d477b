"""Any ONNX network of the YOLO family as one function: image in, candidate boxes out (paper, Object Detection).

The paper runs YOLOv3 under TensorRT; here the best available provider runs it: TensorRT, CUDA or CPU.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
import onnx
import onnxruntime as ort

from pipeline.common.files.data_dir import file_sha256
from pipeline.inference import model_registry
from pipeline.inference.distance_laws import find_law
from pipeline.inference.graph import MULTIPLE, Size, fitting_size, input_size, with_input_size, with_unit_image
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
from pipeline.types import F32, REAL_VEHICLES, U8, DistanceLaw, RawBoxes
from pipeline.vision.classes import class_names
from pipeline.vision.heads import Decoder, UnknownHead, pick_decoder

FLOOR_SCORE = 0.05
"""Candidates with a lower score are discarded; ``detection.min_score`` cannot go below it."""
PADDING = 114
"""Grey value that fills the rest of the input, as in training of the YOLO family."""
_FREE_SIZE: Size = (384, 640)
"""Default input size, 16:9, of a graph without a fixed size if the image size is not known yet."""
_SIMULATED_ONLY = (
    "using the embedded detector, trained on simulated cars only; get a real one with `cipv models pull yolox_nano`"
)


@dataclass(frozen=True)
class Detector:
    """A loaded network."""

    path: Path
    """Its file."""
    name: str
    """File, digest, input size and law: equal names give equal boxes, so this is used as cache key."""
    providers: tuple[str, ...]
    """Execution providers of onnxruntime, in the order in which they are tried for each node."""
    input_size: Size
    """(height, width)."""
    labels: tuple[str, ...]
    """Class names in COCO's spelling, by class id."""
    law: DistanceLaw
    """Distance from the heights of its boxes."""
    head: str
    """Name of its output format (head)."""
    notes: tuple[str, ...]
    """What a user should know about how it was loaded."""
    threads: int
    """How many threads it runs on."""
    sha256: str
    """Hash of the file, hexadecimal."""
    graph: bytes = field(repr=False, compare=False)
    """The ONNX graph that runs, at this input size."""
    _session: ort.InferenceSession = field(repr=False, compare=False)
    _decoder: Decoder = field(repr=False, compare=False)

    def detect(self, bgr: U8) -> RawBoxes:
        """Candidates with a score of at least ``FLOOR_SCORE`` in an image (H, W, 3) uint8, boxes clipped to it, best
        first.

        DetectorError for an array that is not such an image, or if the network fails on it.
        """
        check_image(bgr)
        return self.decode(run_session(self._session, self.blob(bgr)), (bgr.shape[0], bgr.shape[1]))

    def blob(self, bgr: U8) -> F32:
        """The image as the network's input: (1, 3, h, w) float32, scaled to fit in the top left corner, the rest
        grey."""
        scale = _scale((bgr.shape[0], bgr.shape[1]), self.input_size)
        height, width = (max(1, min(round(n * scale), m)) for n, m in zip(bgr.shape[:2], self.input_size, strict=True))
        filled = np.full((*self.input_size, 3), PADDING, np.uint8)
        filled[:height, :width] = cv2.resize(bgr, (width, height), interpolation=cv2.INTER_LINEAR)
        blob = cv2.dnn.blobFromImage(filled, scalefactor=self._decoder.scale, swapRB=self._decoder.rgb)
        return np.asarray(blob, dtype=np.float32)

    def decode(self, outputs: Sequence[F32], image: Size) -> RawBoxes:
        """Converts the network's raw outputs to boxes in pixels of an image of (height, width)."""
        boxes, scores, classes = self._decoder.decode(outputs, self.input_size, FLOOR_SCORE)
        height, width = image
        edges = np.array([width, height, width, height], np.float32)
        boxes = np.clip(boxes / np.float32(_scale(image, self.input_size)), 0.0, edges)
        keep = (boxes[:, 2] > boxes[:, 0]) & (boxes[:, 3] > boxes[:, 1]) & (classes >= 0) & (classes < len(self.labels))
        best_first = np.flatnonzero(keep)[np.argsort(-scores[keep], kind="stable")]
        labels = tuple(self.labels[index] for index in classes[best_first])
        return RawBoxes(self.name, boxes[best_first].astype(np.float32), scores[best_first], labels, self.law)


def open_detector(
    spec: str | None,
    image_size: tuple[int, int] | None,
    threads: int = USUAL_THREADS,
    input_size: Size | None = None,
) -> Detector:
    """Load a network by name or path. Without one, load the default (``pipeline.inference.model_registry``), with a
    note if that is the embedded network.

    image_size (width, height): the input gets the image's aspect ratio if the graph permits. input_size (height,
    width), multiples of 32: this size instead, or DetectorError. DetectorMissing if there is no file, DetectorError if
    the file is not a YOLO network that can be run.
    """
    path = _locate(spec)
    notes = (_SIMULATED_ONLY,) if spec is None and path == model_registry.find(model_registry.EMBEDDED) else ()
    model = with_unit_image(read_graph(path))
    own = _own_size(model, path)
    if input_size is not None:
        if min(input_size) < MULTIPLE or any(side % MULTIPLE for side in input_size):
            raise DetectorError(
                f"input width and height must be multiples of {MULTIPLE}, not {input_size[1]}×{input_size[0]}"
            )
        return _at_size(model, path, own, input_size, threads, notes)
    wanted = fitting_size(image_size, own) if image_size else own or _FREE_SIZE
    try:
        return _at_size(model, path, own, wanted, threads, notes)
    except DetectorError as error:
        if own is None or wanted == own:
            raise
        refusal = str(error)
    note = f"{path.name} works only at its own input size {own[1]}×{own[0]} (at {wanted[1]}×{wanted[0]}: {refusal})"
    return _at_size(model, path, own, own, threads, (*notes, note))


def _locate(spec: str | None) -> Path:
    path = find_graph(spec, "detector")
    if path is not None:
        return path
    what = f"No detector {spec!r}" if spec else "No detector is installed"
    raise DetectorMissing(f"{what}: run `cipv models pull yolox_nano`, or give an ONNX file with `--detector PATH`.")


def _own_size(model: onnx.ModelProto, path: Path) -> Size | None:
    try:
        return input_size(model)
    except ValueError as error:
        raise DetectorError(f"{path.name} is not an image detector: {error}") from None


def _at_size(
    model: onnx.ModelProto, path: Path, own: Size | None, size: Size, threads: int, notes: tuple[str, ...] = ()
) -> Detector:
    """The detector at one input size, tested by running it on a grey image."""
    try:
        graph = (model if own == size else with_input_size(model, size)).SerializeToString()
    except ValueError as error:
        raise DetectorError(f"{path.name} cannot be run: {error}") from None
    session = open_session(graph, path, threads)
    metadata = {entry.key: entry.value for entry in model.metadata_props}
    probe = run_session(session, np.full((1, 3, *size), PADDING, np.float32))
    try:
        decoder = pick_decoder(probe, size, metadata)
    except UnknownHead as error:
        raise DetectorError(f"{path.name}: {error}") from None
    if own is not None and own != size and not decoder.own_grid and own[0] * own[1] == size[0] * size[1]:
        # The graph may contain a grid of the old width: the run would succeed, but every box would be misplaced.
        raise DetectorError("the graph may contain a grid for a fixed size")
    labels = class_names(decoder.classes, metadata)
    found = find_law(path)
    sha256 = file_sha256(path)
    name = f"{path.stem}-{sha256[:12]}-{size[1]}x{size[0]}{_name_of(found.law)}"
    return Detector(
        path,
        name,
        tuple(session.get_providers()),
        size,
        labels,
        found.law or REAL_VEHICLES,
        decoder.name,
        (*notes, *((found.note,) if found.note else ()), *file_notes(path, sha256)),
        session.get_session_options().intra_op_num_threads,
        sha256,
        graph,
        session,
        decoder,
    )


def _name_of(law: DistanceLaw | None) -> str:
    """Part of a detector's name for its law; empty for a detector without its own law."""
    return f"-law{hashlib.sha256(repr(law).encode()).hexdigest()[:8]}" if law is not None else ""


def _scale(image: Size, size: Size) -> float:
    """Input pixels per image pixel, both (height, width)."""
    return min(size[0] / image[0], size[1] / image[1])
