"""The training loss."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn import functional as F

from pipeline.inference.graph import Size
from pipeline.training.targets import IGNORED
from pipeline.vision.heads.decoder import grid_centres

_IOU_WEIGHT, _OFFSET_WEIGHT = 3.0, 1.0
_MOST_LOG_SIZE = 6.0


@dataclass(frozen=True)
class Losses:
    """The terms of the loss, averaged over the cells assigned to a vehicle."""

    total: Tensor
    """The minimised sum; the only one with a gradient."""
    objectness: float
    """Quality focal loss of the objectness, whose target is the box's IoU."""
    classes: float
    """Cross-entropy of the class scores."""
    iou: float
    """Generalised IoU loss of the boxes."""


def losses(logits: Tensor, labels: Tensor, boxes: Tensor, size: Size) -> Losses:
    """The losses for logits (B, N, 5 + C), given labels (B, N) and boxes (B, N, 4) from ``targets``.

    The target of objectness is the box's IoU, weighted by its error (quality focal loss, Li 2020), so that the
    candidate with the best box wins. Boxes: generalised IoU (Rezatofighi 2019) plus L1 of the raw outputs, which is
    more sensitive to the height of far vehicles of ten pixels.
    """
    cells, strides = (torch.from_numpy(part) for part in grid_centres(size))
    positive = labels >= 0
    count = positive.sum().clamp(min=1)
    raw, box = logits[..., :4][positive], boxes[positive]
    cell, stride = cells.expand(len(logits), -1, -1)[positive], strides.expand(len(logits), -1, -1)[positive]
    centre = (raw[:, :2] + cell) * stride
    extent = raw[:, 2:].clamp(max=_MOST_LOG_SIZE).exp() * stride
    iou, giou = _overlap(torch.cat([centre - extent / 2, centre + extent / 2], dim=1), box)
    wanted = torch.cat(
        [(box[:, :2] + box[:, 2:]) / 2 / stride - cell, ((box[:, 2:] - box[:, :2]) / stride).clamp(min=1e-3).log()], 1
    )
    fit = _IOU_WEIGHT * (1.0 - giou).sum() + _OFFSET_WEIGHT * F.smooth_l1_loss(raw, wanted, reduction="sum", beta=0.1)

    quality = torch.zeros_like(logits[..., 4])
    quality[positive] = iou.detach().clamp(min=0.0)
    error = (logits[..., 4].sigmoid() - quality).abs().square()
    entropy = F.binary_cross_entropy_with_logits(logits[..., 4], quality, reduction="none")
    objectness = (error * entropy)[labels != IGNORED].sum()

    named = F.one_hot(labels[positive], logits.shape[2] - 5).to(logits.dtype)
    classes = F.binary_cross_entropy_with_logits(logits[..., 5:][positive], named, reduction="sum")
    total = (fit + 2.0 * objectness + classes) / count
    return Losses(
        total, objectness.item() / count.item(), classes.item() / count.item(), iou.mean().item() if len(iou) else 0.0
    )


def _overlap(a: Tensor, b: Tensor) -> tuple[Tensor, Tensor]:
    """(M,) IoU and (M,) generalised IoU of two lists of (M, 4) boxes, element-wise."""
    inner = (torch.minimum(a[:, 2:], b[:, 2:]) - torch.maximum(a[:, :2], b[:, :2])).clamp(min=0).prod(dim=1)
    outer = (torch.maximum(a[:, 2:], b[:, 2:]) - torch.minimum(a[:, :2], b[:, :2])).prod(dim=1)
    union = (a[:, 2:] - a[:, :2]).prod(dim=1) + (b[:, 2:] - b[:, :2]).prod(dim=1) - inner
    iou = inner / union.clamp(min=1e-6)
    return iou, iou - (outer - union) / outer.clamp(min=1e-6)
