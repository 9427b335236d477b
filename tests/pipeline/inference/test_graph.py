"""A network whose graph contradicts itself is refused in one sentence, not with an error class of a library."""

from __future__ import annotations

from pathlib import Path

import onnx
import pytest
from onnx import TensorProto, helper

from pipeline.common.errors import BadInput
from pipeline.inference.graph import with_input_size
from pipeline.inference.runtime import ways_of


def network(path: Path) -> onnx.ModelProto:
    """Takes images of any size, and uses an operator of a set that it does not import."""
    graph = helper.make_graph(
        [helper.make_node("Relu", ["images"], ["out"], domain="unknown")],
        "contradiction",
        [helper.make_tensor_value_info("images", TensorProto.FLOAT, [1, 3, "height", "width"])],
        [helper.make_tensor_value_info("out", TensorProto.FLOAT, None)],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8)
    onnx.save(model, path)
    return model


def test_a_graph_that_contradicts_itself_is_refused_in_a_sentence(tmp_path: Path) -> None:
    model = network(tmp_path / "a.onnx")
    with pytest.raises(ValueError, match=r"^its shapes contradict each other: .+$"):
        with_input_size(model, (64, 96))
    with pytest.raises(BadInput, match=r"^a\.onnx cannot be tuned: its shapes contradict each other: .+$"):
        ways_of(tmp_path / "a.onnx")
