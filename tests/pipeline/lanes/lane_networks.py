"""Tiny ONNX lane networks: real graphs that onnxruntime runs, whose lines are the red and the green of the image."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

IR_VERSION = 8
Size = tuple[int | str, int | str]


def _saved(path: Path, nodes: list, weights: dict[str, np.ndarray], outputs: list[str], size: Size) -> Path:
    graph = helper.make_graph(
        nodes,
        "tiny",
        [helper.make_tensor_value_info("images", TensorProto.FLOAT, [1, 3, *size])],
        [helper.make_tensor_value_info(name, TensorProto.FLOAT, None) for name in outputs],
        [numpy_helper.from_array(values.astype(np.float32), name) for name, values in weights.items()],
    )
    onnx.save(helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=IR_VERSION), path)
    return path


def _linear(name: str, rows: list[tuple[float, float, float, float]]) -> tuple[onnx.NodeProto, dict[str, np.ndarray]]:
    """Each output channel is a·first + b·second + c·third + d of a pixel's channels."""
    weight = np.array([row[:3] for row in rows]).reshape(len(rows), 3, 1, 1)
    bias = np.array([row[3] for row in rows])
    node = helper.make_node("Conv", ["images", f"{name}_w", f"{name}_b"], [name])
    return node, {f"{name}_w": weight, f"{name}_b": bias}


_NOTHING = (0.0, 0.0, 0.0, 0.0)


def twin(path: Path, size: Size = (72, 128), attention: bool = False, windows: bool = False) -> Path:
    """Two masks: drivable where blue (0–1) is above one half, and a line where red is.

    attention: as in TwinLiteNet's export, a map is flattened to (1, channels, h·w) and restored, with its size as a
    constant. windows: as in TwinLiteNetPlus, it is divided into windows of a fixed size.
    """
    road, first = _linear("da", [_NOTHING, (0.0, 0.0, 40.0, -20.0)])
    line, second = _linear("ll", [_NOTHING, (40.0, 0.0, 0.0, -20.0)])
    nodes = [road, line]
    if attention or windows:
        line.output[0] = "own"
        height, width = int(size[0]), int(size[1])
        parts = (1, -1, height * width) if attention else (1, 2, 2, height // 2, 2, width // 2)
        for name, shape in (("parts", parts), ("map", (1, 2, height, width))):
            value = numpy_helper.from_array(np.array(shape, np.int64))
            nodes.append(helper.make_node("Constant", [], [name], value=value))
        nodes += [
            helper.make_node("Reshape", ["own", "parts"], ["divided"]),
            helper.make_node("Neg", ["divided"], ["turned"]),  # otherwise the runtime makes one Reshape of both
            helper.make_node("Reshape", ["turned", "map"], ["restored"]),
            helper.make_node("Neg", ["restored"], ["ll"]),
        ]
    return _saved(path, nodes, {**first, **second}, ["da", "ll"], size)


def yolop(path: Path, size: Size = (128, 128)) -> Path:
    """Boxes and two masks; full red exceeds 1.5 only after normalisation with ImageNet's mean and deviation."""
    road, first = _linear("drive_area_seg", [_NOTHING, (0.0, 0.0, 0.0, -9.0)])
    line, second = _linear("lane_line_seg", [_NOTHING, (40.0, -20.0, -20.0, -60.0)])
    none = helper.make_node("Identity", ["boxes"], ["det_out"])
    weights = {**first, **second, "boxes": np.zeros((1, 10, 6))}
    return _saved(path, [none, road, line], weights, ["det_out", "drive_area_seg", "lane_line_seg"], size)


def lstr(path: Path, size: Size = (72, 128)) -> Path:
    """Two curves and a mask that must be empty. The first curve is the upright line at x = 0.5 from the middle of the
    input to its lower edge; the second has a low score. Real exports have further outputs of the same shapes, left from
    training."""
    upright, elsewhere = (0.5, 1.0, 0.0, 0.4, 0.0, 0.5, 0.0, 0.0), (0.5, 1.0, 0.0, 0.4, 0.0, 0.1, 0.0, 0.0)
    weights = {
        "scores": np.array([[(-4.0, 4.0), (4.0, -4.0)]]),
        "lines": np.array([[upright, elsewhere]]),
        "axes": np.array([0.0]),
    }
    nodes = [
        helper.make_node("ReduceMax", ["input_mask"], ["filled"], keepdims=0),
        helper.make_node("ReduceMean", ["images"], ["seen"], keepdims=0),
        helper.make_node("Mul", ["seen", "axes"], ["nothing"]),
        helper.make_node("Add", ["filled", "nothing"], ["moved"]),
        helper.make_node("Identity", ["scores"], ["pred_logits"]),
        helper.make_node("Add", ["lines", "moved"], ["pred_curves"]),
        helper.make_node("Identity", ["scores"], ["foo_out_1"]),
    ]
    _saved(path, nodes, weights, ["pred_logits", "pred_curves", "foo_out_1"], size)
    model = onnx.load(path)
    model.graph.input.append(helper.make_tensor_value_info("input_mask", TensorProto.FLOAT, [1, 1, *size]))
    onnx.save(model, path)
    return path


def classes(path: Path, size: Size = (72, 128), there: tuple[float, ...] = (0.0, 1.0, 1.0, 0.0)) -> Path:
    """Five classes: red is the second line, green the third. there: probability of each line."""
    rows = [(0.0, 0.0, 0.0, 20.0), _NOTHING, (40.0, -20.0, -20.0, 0.0), (-20.0, 40.0, -20.0, 0.0), _NOTHING]
    node, weights = _linear("seg", rows)
    exist = helper.make_node("Identity", ["there"], ["exist"])
    return _saved(path, [node, exist], {**weights, "there": np.array([there])}, ["seg", "exist"], size)


def rows(path: Path, anchors: int = 56, cells: int = 100, cell: int = 25) -> Path:
    """A row grid whose second line is in ``cell`` in every row, without other lines."""
    values = np.zeros((1, cells + 1, anchors, 4))
    values[0, cells] = 10.0
    values[0, cells, :, 1] = 0.0
    values[0, cell, :, 1] = 20.0
    nodes = [
        helper.make_node("ReduceMean", ["images"], ["mean"], keepdims=1),
        helper.make_node("Mul", ["mean", "zero"], ["nothing"]),
        helper.make_node("Add", ["values", "nothing"], ["lanes"]),
    ]
    return _saved(path, nodes, {"values": values, "zero": np.zeros((1, 1, 1, 1))}, ["lanes"], (288, 800))
