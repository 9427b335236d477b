"""Tiny ONNX networks for tests: real graphs for onnxruntime, whose outputs are simple functions of the image."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

CHANNELS = 85
IR_VERSION = 8


def _constant(name: str, values: np.ndarray) -> onnx.TensorProto:
    return numpy_helper.from_array(values, name)


def _save(
    path: Path, nodes: list, weights: list, outputs: list[str], size: tuple[int | str, int | str], **metadata: str
) -> Path:
    graph = helper.make_graph(
        nodes,
        "tiny",
        [helper.make_tensor_value_info("images", TensorProto.FLOAT, [1, 3, *size])],
        [helper.make_tensor_value_info(name, TensorProto.FLOAT, None) for name in outputs],
        weights,
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=IR_VERSION)
    helper.set_model_props(model, metadata)
    onnx.save(model, path)
    return path


def yolox(path: Path, size: tuple[int | str, int | str] = (64, 64), baked_size: bool = False) -> Path:
    """A YOLOX-shaped network without training: each cell's objectness is how bright its centre is, its class is 2
    (car) and its box is two cells wide and one high. ``baked_size``: its reshapes hold the exported size, as exports
    without dynamic shapes do."""
    nodes, flat, weights = [], [], []
    for stride in (8, 16, 32):
        weight = np.zeros((CHANNELS, 3, 1, 1), np.float32)
        weight[4] = 1 / (3 * 255)
        bias = np.zeros(CHANNELS, np.float32)
        bias[[0, 1]] = 0.5
        bias[2] = np.log(2.0)
        bias[5 + 2] = 1.0
        cells = int(size[0]) // stride * (int(size[1]) // stride) if baked_size else -1
        weights += [
            _constant(f"w{stride}", weight),
            _constant(f"b{stride}", bias),
            _constant(f"s{stride}", np.array([1, CHANNELS, cells], np.int64)),
        ]
        nodes += [
            helper.make_node(
                "AveragePool", ["images"], [f"p{stride}"], kernel_shape=[stride] * 2, strides=[stride] * 2
            ),
            helper.make_node("Conv", [f"p{stride}", f"w{stride}", f"b{stride}"], [f"c{stride}"]),
            helper.make_node("Reshape", [f"c{stride}", f"s{stride}"], [f"f{stride}"]),
        ]
        flat.append(f"f{stride}")
    nodes += [
        helper.make_node("Concat", flat, ["all"], axis=2),
        helper.make_node("Transpose", ["all"], ["output"], perm=[0, 2, 1]),
    ]
    return _save(path, nodes, weights, ["output"], size)


def yolov8(path: Path, size: tuple[int, int] = (64, 64)) -> Path:
    """A v8-shaped network whose grid is a constant of its own size, with one sure "lorry" per image: the box around
    the whole input. Its score is the image's mean red, which tells RGB from BGR and 0–1 from 0–255."""
    cells = sum((size[0] // s) * (size[1] // s) for s in (8, 16, 32))
    boxes = np.zeros((1, 4, cells), np.float32)
    boxes[0, :, 0] = (size[1] / 2, size[0] / 2, size[1], size[0])
    first = np.zeros((1, 1, cells), np.float32)
    first[0, 0, 0] = 1.0
    weights = [
        _constant("boxes", boxes),
        _constant("first", first),
        _constant("red", np.array([1.0, 0.0, 0.0], np.float32).reshape(1, 3, 1, 1)),
        _constant("shape", np.array([1, 1, 1], np.int64)),
    ]
    nodes = [
        helper.make_node("GlobalAveragePool", ["images"], ["mean"]),
        helper.make_node("Mul", ["mean", "red"], ["only_red"]),
        helper.make_node("ReduceSum", ["only_red"], ["score"], keepdims=1),
        helper.make_node("Reshape", ["score", "shape"], ["flat"]),
        helper.make_node("Mul", ["first", "flat"], ["lorry"]),
        helper.make_node("Sub", ["first", "first"], ["walker"]),
        helper.make_node("Concat", ["boxes", "walker", "lorry"], ["output"], axis=1),
    ]
    return _save(path, nodes, weights, ["output"], size, names="{0: 'Pedestrian', 1: 'lorry'}")


def detr(path: Path) -> Path:
    """A DETR-shaped network of 64×64 with a second input for the size of the image, in whose pixels its boxes are: a
    car in the left upper quarter and a person on the right. Both score the image's mean red."""
    weights = [
        _constant("shares", np.array([[[0.0, 0.0, 0.5, 0.5], [0.75, 0.0, 1.0, 1.0]]], np.float32)),
        _constant("numbers", np.array([[2, 0]], np.int64)),
        _constant("only", np.array([1.0, 0.0, 0.0], np.float32).reshape(1, 3, 1, 1)),
        _constant("flat", np.array([1, 1], np.int64)),
        _constant("both", np.array([[1.0, 1.0]], np.float32)),
    ]
    nodes = [
        helper.make_node("Cast", ["orig_target_sizes"], ["sides"], to=TensorProto.FLOAT),
        helper.make_node("Concat", ["sides", "sides"], ["corners"], axis=1),
        helper.make_node("Mul", ["shares", "corners"], ["boxes"]),
        helper.make_node("Identity", ["numbers"], ["labels"]),
        helper.make_node("GlobalAveragePool", ["images"], ["mean"]),
        helper.make_node("Mul", ["mean", "only"], ["red"]),
        helper.make_node("ReduceSum", ["red"], ["sum"], keepdims=1),
        helper.make_node("Reshape", ["sum", "flat"], ["one"]),
        helper.make_node("Mul", ["one", "both"], ["scores"]),
    ]
    graph = helper.make_graph(
        nodes,
        "tiny",
        [
            helper.make_tensor_value_info("images", TensorProto.FLOAT, ["N", 3, 64, 64]),
            helper.make_tensor_value_info("orig_target_sizes", TensorProto.INT64, ["N", 2]),
        ],
        [
            helper.make_tensor_value_info("labels", TensorProto.INT64, None),
            helper.make_tensor_value_info("boxes", TensorProto.FLOAT, None),
            helper.make_tensor_value_info("scores", TensorProto.FLOAT, None),
        ],
        weights,
    )
    onnx.save(helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=IR_VERSION), path)
    return path


def classifier(path: Path) -> Path:
    """A network that is not a detector."""
    return _save(path, [helper.make_node("GlobalAveragePool", ["images"], ["output"])], [], ["output"], (64, 64))
