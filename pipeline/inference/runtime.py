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
from pipeline.types import F32

_GIVES_WAY = 5
"""How much nicer than who opens it a network's own threads are. Alike, a step that runs meanwhile may share its core
with one of them for seconds on end and take twice as long. The thread that asks computes too and stays as it is: with
all of them nicer the network would lose to whatever else runs."""
_FATAL = 4
"""What is said on standard error; all else comes as an exception."""
_PROVIDERS = ("TensorrtExecutionProvider", "CUDAExecutionProvider", "CPUExecutionProvider")


class DetectorMissing(BadInput):
    """There is no network to run. The text is a sentence with the remedy."""


class DetectorError(BadInput):
    """A network that cannot be run, or a picture that is none. The text is a sentence for a person."""


def find_graph(spec: str | None, task: model_registry.Task) -> Path | None:
    """The file of a name or path; without either the task's default. Null when it is not here; DetectorMissing when
    the folder of networks itself is damaged."""
    try:
        return model_registry.find(spec) if spec else model_registry.default_model(task)
    except model_registry.ModelError as error:
        raise DetectorMissing(str(error)) from None


def read_graph(path: Path) -> onnx.ModelProto:
    """The graph in a file. DetectorError when it holds none."""
    try:
        return onnx.load(path)
    except Exception as error:  # protobuf's own errors have no common base class
        raise DetectorError(f"{path} is not an ONNX file: {str(error).splitlines()[0]}") from None


def open_session(graph: bytes, path: Path, threads: int) -> ort.InferenceSession:
    """The graph on the best provider that takes it: TensorRT, CUDA, CPU. path: for the error alone."""
    # Threads are as nice as the one that starts them, and a thread without rights cannot take that back: so not ours.
    with ThreadPoolExecutor(1, "cipv-open-network", _give_way) as opener:
        return opener.submit(_open, graph, path, threads).result()


def _give_way() -> None:
    """Make this thread, and those that it will start, nicer. On other systems than Linux niceness is a process's."""
    if sys.platform == "linux":
        this = threading.get_native_id()
        with suppress(OSError):  # a sandbox may refuse; then all run alike
            os.setpriority(os.PRIO_PROCESS, this, os.getpriority(os.PRIO_PROCESS, this) + _GIVES_WAY)


def _open(graph: bytes, path: Path, threads: int) -> ort.InferenceSession:
    options = ort.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    options.log_severity_level = _FATAL
    # Spinning workers starve the LiDAR chain between two pictures.
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    available = [name for name in _PROVIDERS if name in ort.get_available_providers()]
    refusal: Exception | None = None
    for first in range(len(available)):
        try:
            return ort.InferenceSession(graph, options, providers=available[first:])
        except Exception as error:  # onnxruntime raises a class for each status code, without a common base
            refusal = error
    raise DetectorError(f"{path.name} cannot be run: {_first_line(refusal)}")


def run_session(session: ort.InferenceSession, blob: F32) -> Sequence[F32]:
    """Every output for one input. DetectorError when the network fails on it, Stopped when it was told to end."""
    options, stop = ort.RunOptions(), of_this_thread()
    options.log_severity_level = _FATAL
    with stop.ends(options):
        try:
            outputs = session.run(None, {session.get_inputs()[0].name: blob}, options)
        except Exception as error:
            if stop.is_set:
                raise Stopped from None
            raise DetectorError(f"the network failed: {_first_line(error)}") from None
    return [np.asarray(output) for output in outputs]


def _first_line(error: Exception | None) -> str:
    return (str(error).splitlines() or ["no reason given"])[0]
