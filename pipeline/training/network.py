"""A small anchor-free detector with YOLOX's head (Ge 2021, section 2.1), so that YOLOX's decoder reads it.

Input (B, 3, H, W) float32, blue green red from 0 to 255, H and W multiples of 32. Output (B, N, 5 + C) for the N cells
of strides 8, 16 and 32, row by row: centre relative to the cell and log size, both in strides, objectness, classes.

``python -m pipeline.training.network WEIGHTS.pt OUT.onnx`` writes trained weights as ONNX.
"""

from __future__ import annotations

import sys
from pathlib import Path

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from pipeline.inference.graph import Size
from pipeline.training.labels import CLASSES
from pipeline.vision.detector import PADDING
from pipeline.vision.heads.decoder import STRIDES

INPUT_SIZE: Size = (384, 640)
WIDTHS = (16, 24, 48, 80, 128)
"""Number of channels at strides 2, 4, 8, 16 and 32."""
NECK = 48
_CONTRAST = 64.0
_SURENESS = (1.3, 1.3, 1.3, 0.8)
"""Exponent of objectness in the score of each of ``CLASSES``. Objectness is trained to equal the box's IoU, and reaches
0.4 for false boxes too; the exponent 1.3 moves the best threshold, 0.4, to the product's default of 0.3. Boxes of
motorcycles are narrow, so even correct ones have a low IoU and score: with 1.3, motorcycles were most of the missed
leads. With 0.8, six in ten of their boxes are correct instead of eight, but a missed lead costs more."""
_PRIOR_LOGIT = -4.6  # prior of one cell in a hundred with an object, for stable first steps (Lin 2017, section 3.3)


def conv(inputs: int, outputs: int, kernel: int, stride: int = 1, groups: int = 1) -> nn.Sequential:
    """Convolution, batch normalisation, ReLU."""
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, kernel, stride, kernel // 2, groups=groups, bias=False),
        nn.BatchNorm2d(outputs, momentum=0.03),
        nn.ReLU(inplace=True),
    )


class Residual(nn.Module):
    """Adds to its input a 3×3 convolution with half the channels (He 2016)."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.body = nn.Sequential(conv(channels, channels // 2, 1), conv(channels // 2, channels, 3))

    def forward(self, x: Tensor) -> Tensor:
        return torch.add(x, self.body(x))


class DecoupledHead(nn.Module):
    """Boxes and objectness on one branch, classes on another (Ge 2021, decoupled head), depthwise for speed."""

    def __init__(self, channels: int, classes: int) -> None:
        super().__init__()
        self.box_branch = nn.Sequential(conv(channels, channels, 3, groups=channels), conv(channels, channels, 1))
        self.class_branch = nn.Sequential(conv(channels, channels, 3, groups=channels), conv(channels, channels, 1))
        self.box = nn.Conv2d(channels, 5, 1)
        self.classes = nn.Conv2d(channels, classes, 1)
        nn.init.constant_(self.box.bias[4:], _PRIOR_LOGIT)

    def forward(self, x: Tensor) -> Tensor:
        """(B, 5 + C, h, w) logits."""
        return torch.cat([self.box(self.box_branch(x)), self.classes(self.class_branch(x))], dim=1)


class DetectorNetwork(nn.Module):
    """Residual backbone, top-down feature pyramid (Lin 2017), three heads."""

    def __init__(self) -> None:
        super().__init__()
        w2, w4, w8, w16, w32 = WIDTHS
        self.to_8 = nn.Sequential(conv(3, w2, 3, 2), conv(w2, w4, 3, 2), conv(w4, w8, 3, 2), Residual(w8), Residual(w8))
        self.to_16 = nn.Sequential(conv(w8, w16, 3, 2), Residual(w16), Residual(w16))
        self.to_32 = nn.Sequential(conv(w16, w32, 3, 2), Residual(w32), Residual(w32))
        self.lateral = nn.ModuleList(conv(width, NECK, 1) for width in (w8, w16, w32))
        self.fuse = nn.ModuleList(Residual(NECK) for _ in STRIDES)
        self.heads = nn.ModuleList(DecoupledHead(NECK, len(CLASSES)) for _ in STRIDES)

    def forward(self, bgr: Tensor) -> Tensor:
        """(B, N, 5 + C) logits."""
        at_8 = self.to_8((bgr - PADDING) / _CONTRAST)
        at_16 = self.to_16(at_8)
        at_32 = self.to_32(at_16)
        p8, p16, p32 = (layer(x) for layer, x in zip(self.lateral, (at_8, at_16, at_32), strict=True))
        p16 = p16 + F.interpolate(p32, scale_factor=2.0, mode="nearest")
        p8 = p8 + F.interpolate(p16, scale_factor=2.0, mode="nearest")
        levels = [head(fuse(x)).flatten(2) for head, fuse, x in zip(self.heads, self.fuse, (p8, p16, p32), strict=True)]
        return torch.cat(levels, dim=2).transpose(1, 2)


class ExportedNetwork(nn.Module):
    """The network with probabilities instead of logits, as written to ONNX."""

    def __init__(self, network: DetectorNetwork) -> None:
        super().__init__()
        self.network = network

    def forward(self, bgr: Tensor) -> Tensor:
        """A score is objectness times class probability. The smallest exponent is applied to objectness and the rest to
        the classes, so that neither exceeds 1."""
        logits = self.network(bgr)
        objectness = torch.sigmoid(logits[..., 4:5])
        common = min(_SURENESS)
        own = objectness ** torch.tensor([power - common for power in _SURENESS])
        return torch.cat([logits[..., :4], objectness**common, torch.sigmoid(logits[..., 5:]) * own], dim=2)


def export(network: DetectorNetwork, path: Path, size: tuple[int, int]) -> None:
    """Write the ONNX file for an input of (height, width), with the class names in its metadata."""
    import onnx

    model = ExportedNetwork(network).eval()
    torch.onnx.export(
        model,
        (torch.zeros(1, 3, *size),),
        str(path),
        input_names=["images"],
        output_names=["output"],
        opset_version=17,
        dynamo=False,
    )
    written = onnx.load(path)
    onnx.helper.set_model_props(written, {"names": str(dict(enumerate(CLASSES)))})
    onnx.save(written, path)


def main() -> None:
    weights, out = map(Path, sys.argv[1:])
    network = DetectorNetwork()
    network.load_state_dict(torch.load(weights))
    export(network, out, INPUT_SIZE)


if __name__ == "__main__":
    main()
