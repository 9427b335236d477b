"""Denormal numbers: none is left in a graph's weights, and none is computed while a network runs."""

from __future__ import annotations

import platform
import sys
from pathlib import Path

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper, numpy_helper

from pipeline.inference.denormals import flush_to_zero, flush_weights
from pipeline.inference.runtime import open_session, read_graph, run_session
from pipeline.types import F32

TINY = np.float32(1e-40)
SUPPORTED = sys.platform == "linux" and platform.machine() in ("x86_64", "aarch64")
needs_the_register = pytest.mark.skipif(not SUPPORTED, reason="the control word of this system is not known")


def _scaling(weights: F32) -> onnx.ModelProto:
    """A graph that multiplies its input (n,) by ``weights``."""
    both = [helper.make_tensor_value_info(name, TensorProto.FLOAT, [len(weights)]) for name in ("x", "y")]
    graph = helper.make_graph(
        [helper.make_node("Mul", ["x", "w"], ["y"])],
        "scaling",
        both[:1],
        both[1:],
        [numpy_helper.from_array(weights, "w")],
    )
    return helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)


def test_only_denormal_weights_become_zero() -> None:
    smallest = np.finfo(np.float32).tiny
    model = _scaling(np.array([TINY, -TINY, smallest, -smallest, 0.0, 1.0], np.float32))
    assert flush_weights(model) == 2
    assert numpy_helper.to_array(model.graph.initializer[0]).tolist() == [0.0, 0.0, smallest, -smallest, 0.0, 1.0]
    assert flush_weights(model) == 0


@needs_the_register
def test_this_thread_computes_none_meanwhile_and_does_again_later() -> None:
    one = np.ones(4, np.float32)
    with flush_to_zero():
        assert not (one * TINY).any()
    assert (one * TINY).all()


@needs_the_register
@pytest.mark.parametrize("threads", [1, 2])
def test_a_network_computes_none_on_any_of_its_threads(tmp_path: Path, threads: int) -> None:
    path = tmp_path / "scaling.onnx"
    count = 1 << 20  # enough for every thread to get a share
    onnx.save(_scaling(np.full(count, 1e-30, np.float32)), path)
    session = open_session(read_graph(path).SerializeToString(), path, threads)
    (product,) = run_session(session, np.full(count, 1e-10, np.float32))
    assert not product.any()
    assert (np.full(4, 1e-30, np.float32) * np.float32(1e-10)).all(), "the caller's own arithmetic is as before"
