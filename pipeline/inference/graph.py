"""Changes the input size of a detector's ONNX graph.

A fully convolutional network works at any size that its strides divide. Exports nevertheless fix one, usually a square,
in which a wide image of the road is mostly padding. Rewriting the declared shapes in memory lets the same weights
process the image in its own aspect ratio.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import onnx
import onnx.numpy_helper

Size = tuple[int, int]
"""Height and width of a network's input, pixels."""

MULTIPLE = 32
"""Coarsest stride of the YOLO family: input sides are multiples of it."""
MIN_BUDGET = 640 * 384
"""Network pixels always allowed: a small square export (416×416) is otherwise too coarse for a car at 60 m."""
_STRIDES = (1, 2, 4, 8, 16, 32)
"""Of a network's maps, compared with its input."""


def fitting_size(image_size: tuple[int, int], own: Size | None) -> Size:
    """Input (height, width) for an image (width, height): its aspect, sides multiples of 32, as large as the budget
    (the export's own number of pixels, at least 640×384) and the image itself allow.

    2048×618 → 256×832, 1242×375 → 256×832, 1280×720 → 384×640 (height × width) for a 416×416 export.
    """
    image_w, image_h = image_size
    budget = max(MIN_BUDGET, own[0] * own[1] if own else 0)
    best = (MULTIPLE, MULTIPLE)
    for width in range(MULTIPLE, _up(image_w) + 1, MULTIPLE):
        height = _up(width * image_h / image_w)
        if height * width <= budget:
            best = (height, width)
    return best


def input_size(model: onnx.ModelProto) -> Size | None:
    """The graph's fixed input (height, width), None if it is free. ValueError if its input is not a 1×3×H×W image."""
    weights = {tensor.name for tensor in model.graph.initializer}
    inputs = [value for value in model.graph.input if value.name not in weights]
    dims = inputs[0].type.tensor_type.shape.dim if len(inputs) == 1 else []
    if len(dims) != 4 or dims[0].dim_value > 1 or dims[1].dim_value not in (0, 3):
        raise ValueError("its input is not one image of 1×3×height×width")
    if inputs[0].type.tensor_type.elem_type != onnx.TensorProto.FLOAT:
        raise ValueError("its input is not float32")
    height, width = dims[2].dim_value, dims[3].dim_value
    return (height, width) if height and width else None


def with_unit_image(model: onnx.ModelProto) -> onnx.ModelProto:
    """A graph whose second input is the size of the original image (N, 2), as in DETR exports, with that input bound to
    1 × 1, so that its boxes are fractions of the input's sides. Other graphs are returned unchanged."""
    weights = {tensor.name for tensor in model.graph.initializer}
    inputs = [value for value in model.graph.input if value.name not in weights]
    sizes = inputs[1:]
    if len(sizes) != 1 or sizes[0].type.tensor_type.elem_type != onnx.TensorProto.INT64:
        return model
    dims = sizes[0].type.tensor_type.shape.dim
    if len(dims) != 2 or dims[1].dim_value != 2:
        return model
    bound = onnx.ModelProto()
    bound.CopyFrom(model)
    bound.graph.initializer.append(onnx.helper.make_tensor(sizes[0].name, onnx.TensorProto.INT64, (1, 2), (1, 1)))
    kept = [value for value in bound.graph.input if value.name != sizes[0].name]
    del bound.graph.input[:]
    bound.graph.input.extend(kept)
    return bound


def with_empty_masks(model: onnx.ModelProto) -> onnx.ModelProto:
    """A copy in which additional inputs of 1×1×height×width are constant zeros: masks of padded areas, of which there
    are none here. The model itself if it has no such input."""
    weights = {tensor.name for tensor in model.graph.initializer}
    inputs = [value for value in model.graph.input if value.name not in weights]
    shapes = {value.name: [dim.dim_value for dim in value.type.tensor_type.shape.dim] for value in inputs}
    masks = [value for value in inputs[1:] if len(shapes[value.name]) == 4 and shapes[value.name][:2] == [1, 1]]
    if not masks or not all(all(shapes[value.name]) for value in masks):
        return model
    filled = onnx.ModelProto()
    filled.CopyFrom(model)
    for value in masks:
        zeros = np.zeros(shapes[value.name], np.float32)
        filled.graph.initializer.append(onnx.numpy_helper.from_array(zeros, value.name))
        filled.graph.input.remove(value)
    return filled


def with_input_size(model: onnx.ModelProto, size: Size) -> onnx.ModelProto:
    """A copy that takes 1×3×size. Every declared shape after the input is dropped and inferred again. If the graph
    contains its old size in constants, this leads to contradictions, which are reported by the runtime or, as
    ValueError, by the shape inference."""
    changed = onnx.ModelProto()
    changed.CopyFrom(model)
    weights = {tensor.name for tensor in changed.graph.initializer}
    for value in changed.graph.input:
        if value.name not in weights:
            for dim, length in zip(value.type.tensor_type.shape.dim, (1, 3, *size), strict=True):
                dim.dim_value = length
    del changed.graph.value_info[:]
    for value in changed.graph.output:
        value.type.tensor_type.ClearField("shape")
    try:
        return onnx.shape_inference.infer_shapes(changed)
    except Exception as error:  # its error class has no common base with Python's own errors
        reason = (str(error).splitlines() or ["no reason given"])[0]
        raise ValueError(f"its shapes contradict each other: {reason}") from None


def with_rows(model: onnx.ModelProto, rows: int) -> onnx.ModelProto:
    """A copy of a fully convolutional network with a fixed input that takes ``rows`` rows instead, as many columns.

    Attention layers of an export reshape their maps to (…, h·w) and back to (…, h, w); such constants, which are the
    old input divided by a stride, are divided from the new one. ValueError if the input is free, or as for
    ``with_input_size``.
    """
    own = input_size(model)
    if own is None:
        raise ValueError("its input has no fixed size")
    changed = onnx.ModelProto()
    changed.CopyFrom(model)
    targets = {name for node in changed.graph.node if node.op_type == "Reshape" for name in node.input[1:]}
    constants = [tensor for tensor in changed.graph.initializer if tensor.name in targets]
    for node in changed.graph.node:
        if node.op_type == "Constant" and node.output[0] in targets:
            constants += [attribute.t for attribute in node.attribute if attribute.name == "value"]
    for tensor in constants:
        shape = onnx.numpy_helper.to_array(tensor)
        tensor.CopyFrom(onnx.numpy_helper.from_array(_scaled(shape, own, rows), tensor.name))
    return with_input_size(changed, (rows, own[1]))


def _scaled(shape: npt.NDArray[np.int64], own: Size, rows: int) -> npt.NDArray[np.int64]:
    """The target of a Reshape for an input of ``rows`` rows, if it ends in the size of a map of the ``own`` input."""
    changed = shape.copy()
    for stride in _STRIDES:
        if own[0] % stride or own[1] % stride or rows % stride:
            continue
        height, width = own[0] // stride, own[1] // stride
        if shape.size > 1 and tuple(shape[-2:]) == (height, width):
            changed[-2] = rows // stride
        elif shape.size and shape[-1] == height * width:
            changed[-1] = rows // stride * width
    return changed


def _up(length: float) -> int:
    return max(1, math.ceil(length / MULTIPLE)) * MULTIPLE
