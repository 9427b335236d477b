"""Running an ONNX graph: which provider, how many threads, and one clear error for whatever goes wrong."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

import numpy as np
import onnx
import onnxruntime as ort

from pipeline.common.errors import BadInput
from pipeline.inference import model_registry
from pipeline.inference.cancellation import Stopped, of_this_thread
from pipeline.inference.denormals import flush_to_zero, flush_weights
from pipeline.types import F32

_GIVES_WAY = 5
"""Niceness added to a network's own threads. At equal priority a step that runs meanwhile may share its core with one
of them for seconds on end and take twice as long. The calling thread computes too and keeps its priority: with all of
them nicer, the network would lose to whatever else runs."""
_FATAL = 4
"""Log level: only this is written to standard error; everything else is raised as an exception."""
_PROVIDERS = ("TensorrtExecutionProvider", "CUDAExecutionProvider", "CPUExecutionProvider")


class DetectorMissing(BadInput):
    """There is no network to run. The text says how to get one."""


class DetectorError(BadInput):
    """A network that cannot be run, or an array that is not a picture. The text is a sentence for the user."""


def find_graph(spec: str | None, task: model_registry.Task) -> Path | None:
    """The file of a network by name or path; without either the task's default. None when it is not installed;
    DetectorMissing when the folder of networks is damaged."""
    try:
        return model_registry.find(spec) if spec else model_registry.default_model(task)
    except model_registry.ModelError as error:
        raise DetectorMissing(str(error)) from None


def read_graph(path: Path) -> onnx.ModelProto:
    """The graph in a file, its denormal weights set to zero. DetectorError when it holds none."""
    try:
        model = onnx.load(path)
    except Exception as error:  # protobuf's own errors have no common base class
        raise DetectorError(f"{path} is not an ONNX file: {str(error).splitlines()[0]}") from None
    flush_weights(model)
    return model


def open_session(graph: bytes, path: Path, threads: int) -> ort.InferenceSession:
    """The graph on the best provider that accepts it: TensorRT, CUDA, CPU. path: only for the error text."""
    # Threads inherit niceness, and an unprivileged thread cannot lower its own again: so another thread opens it.
    with ThreadPoolExecutor(1, "cipv-open-network", _give_way) as opener:
        return opener.submit(_open, graph, path, threads).result()


def _give_way() -> None:
    """Make this thread and those it starts nicer. Only on Linux: elsewhere niceness belongs to the process."""
    if sys.platform == "linux":
        this = threading.get_native_id()
        with suppress(OSError):  # a sandbox may refuse; then all have equal priority
            os.setpriority(os.PRIO_PROCESS, this, os.getpriority(os.PRIO_PROCESS, this) + _GIVES_WAY)


def _open(graph: bytes, path: Path, threads: int) -> ort.InferenceSession:
    options = ort.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    options.log_severity_level = _FATAL
    # Spinning workers starve the LiDAR chain between two pictures.
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.add_session_config_entry("session.set_denormal_as_zero", "1")
    available = [name for name in _PROVIDERS if name in ort.get_available_providers()]
    refusal: Exception | None = None
    for first in range(len(available)):
        try:
            return ort.InferenceSession(graph, options, providers=available[first:])
        except Exception as error:  # onnxruntime raises a class for each status code, without a common base
            refusal = error
    raise DetectorError(f"{path.name} cannot be run: {_first_line(refusal)}")


def run_session(session: ort.InferenceSession, blob: F32) -> Sequence[F32]:
    """Every output for one input. DetectorError when the network fails on it, Stopped when the run was cancelled."""
    options, stop = ort.RunOptions(), of_this_thread()
    options.log_severity_level = _FATAL
    with stop.ends(options), flush_to_zero():
        try:
            outputs = session.run(None, {session.get_inputs()[0].name: blob}, options)
        except Exception as error:
            if stop.is_set:
                raise Stopped from None
            raise DetectorError(f"the network failed: {_first_line(error)}") from None
    return [np.asarray(output) for output in outputs]


def _first_line(error: Exception | None) -> str:
    return (str(error).splitlines() or ["no reason given"])[0]
