"""Runs an ONNX graph: the choice of provider and number of threads, and clear errors."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

import numpy as np
import onnx
import onnxruntime as ort

from pipeline.common.errors import BadInput, first_line
from pipeline.common.fast_replace import evolve
from pipeline.inference import model_registry
from pipeline.inference.cancellation import Stopped, of_this_thread
from pipeline.inference.denormals import flush_to_zero, flush_weights
from pipeline.inference.graph import Size, input_size, with_empty_masks, with_input_size, with_unit_image
from pipeline.inference.known_networks import Task
from pipeline.inference.tuning import RunSettings, kept_way
from pipeline.types import F32, U8

_GIVES_WAY = 5
"""Niceness added to a network's own threads. At equal priority, a pipeline step that runs at the same time may share
its core with one of them for seconds and take twice as long. The calling thread also computes and keeps its priority:
with all threads nicer, the network would lose to any other program."""
_FATAL = 4
"""Log level: only fatal errors are written to standard error; everything else is raised as an exception."""


_TUNED_SIZE: Size = (384, 640)
"""Input size for tuning a graph with free size: 16:9."""


class DetectorMissing(BadInput):
    """There is no network to run. The text says how to get one."""


class DetectorError(BadInput):
    """A network that cannot be run, or an array that is not an image. The text is a sentence for the user."""


def find_graph(spec: str | None, task: Task) -> Path | None:
    """The file of a network by name or path; without either, the task's default. None if it is not installed;
    DetectorMissing if the folder of networks is damaged."""
    try:
        return model_registry.find(spec) if spec else model_registry.default_model(task)
    except model_registry.ModelError as error:
        raise DetectorMissing(str(error)) from None


def read_graph(path: Path) -> onnx.ModelProto:
    """The graph in a file, with its denormal weights set to zero. DetectorError if it contains none, or differs from
    the installed file."""
    try:
        model = onnx.load_from_string(model_registry.read_verified(path))
    except model_registry.ModelError as error:
        raise DetectorError(str(error)) from None
    except Exception as error:  # protobuf's own errors have no common base class
        raise DetectorError(f"{path} is not an ONNX file: {first_line(error)}") from None
    flush_weights(model)
    return model


def open_session(graph: bytes, path: Path, threads: int) -> ort.InferenceSession:
    """The graph with the settings that ``cipv models tune`` found for the file at ``path``; untuned, on the best
    provider that accepts it: TensorRT, CUDA, CPU."""
    # Threads inherit niceness, and an unprivileged thread cannot lower its own again, so a separate thread opens the
    # network.
    with ThreadPoolExecutor(1, "cipv-open-network", _give_way) as opener:
        return opener.submit(_open, graph, path, threads).result()


def _give_way() -> None:
    """Increase the niceness of this thread and of those it starts. Only on Linux: elsewhere niceness applies to the
    process."""
    if sys.platform == "linux":
        this = threading.get_native_id()
        with suppress(OSError):  # a sandbox may refuse this; then all have equal priority
            os.setpriority(os.PRIO_PROCESS, this, os.getpriority(os.PRIO_PROCESS, this) + _GIVES_WAY)


def open_as(graph: bytes, way: RunSettings) -> ort.InferenceSession:
    """The graph with these providers, threads and options. Raises onnxruntime's own errors."""
    options = ort.SessionOptions()
    options.intra_op_num_threads = way.threads
    options.inter_op_num_threads = 1
    options.log_severity_level = _FATAL
    options.graph_optimization_level = getattr(ort.GraphOptimizationLevel, way.optimisation)
    options.enable_cpu_mem_arena = way.arena
    # Spinning workers starve the LiDAR chain between two images.
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.add_session_config_entry("session.set_denormal_as_zero", "1")
    return ort.InferenceSession(graph, options, providers=list(way.providers))


def _open(graph: bytes, path: Path, threads: int) -> ort.InferenceSession:
    way = kept_way(path, threads)
    refusal: Exception | None = None
    for first in range(len(way.providers)):
        try:
            return open_as(graph, evolve(way, providers=way.providers[first:]))
        except Exception as error:  # onnxruntime has an error class for each status code, without a common base
            refusal = error
    raise DetectorError(f"{path.name} cannot be run: {first_line(refusal)}")


def check_image(bgr: U8) -> None:
    """DetectorError for an array that is not an image (H, W, 3) uint8."""
    if bgr.dtype != np.uint8 or bgr.ndim != 3 or bgr.shape[2] != 3 or 0 in bgr.shape:
        raise DetectorError(f"expected an image of (H, W, 3) uint8, got {bgr.shape} {bgr.dtype}")


def run_session(session: ort.InferenceSession, blob: F32) -> Sequence[F32]:
    """All outputs for one input. DetectorError if the network fails on it, Stopped if the run was cancelled."""
    options, stop = ort.RunOptions(), of_this_thread()
    options.log_severity_level = _FATAL
    with stop.ends(options), flush_to_zero():
        try:
            outputs = session.run(None, {session.get_inputs()[0].name: blob}, options)
        except Exception as error:
            if stop.is_set:
                raise Stopped from None
            raise DetectorError(f"the network failed: {first_line(error)}") from None
    return [np.asarray(output) for output in outputs]


def ways_of(path: Path) -> Callable[[RunSettings], Callable[[], Sequence[F32]]]:
    """For ``pipeline.inference.tuning``: runs the network in a file on the same noisy image with different settings.
    DetectorError if its input is not an image."""
    model = with_empty_masks(with_unit_image(read_graph(path)))  # each leaves other graphs unchanged
    try:
        own = input_size(model)
        graph = (model if own else with_input_size(model, _TUNED_SIZE)).SerializeToString()
    except ValueError as error:
        raise DetectorError(f"{path.name} cannot be tuned: {error}") from None
    noise = np.random.default_rng(0).random((1, 3, *(own or _TUNED_SIZE)), np.float32)

    def run(way: RunSettings) -> Callable[[], Sequence[F32]]:
        session = open_as(graph, way)
        return lambda: run_session(session, noise)

    return run
