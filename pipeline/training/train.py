"""Train the embedded detector on the CPU and write it as ONNX.

``python -m pipeline.training.train OUT.onnx FOLDER …``
"""

from __future__ import annotations

import argparse
import copy
import math
import time
from pathlib import Path

import cv2
import numpy as np
import torch

from pipeline.inference.graph import Size
from pipeline.training.augment import view
from pipeline.training.dataset import read_labels
from pipeline.training.loss import losses
from pipeline.training.network import INPUT_SIZE, DetectorNetwork, export
from pipeline.training.targets import assign
from pipeline.types import F32

_WINDOWS: tuple[tuple[Size, int], ...] = (((192, 320), 20), (INPUT_SIZE, 5))
"""Sizes of training windows, (height, width), each with a batch size of about the same cost. The small one costs a
quarter per image and allows more examples of far vehicles, which need them most."""
_SMALL_SHARE = 0.75
_DECAY, _WARM_UP_STEPS = 0.02, 60
_AVERAGE = 0.995
_CLIP = 10.0


class Examples:
    """The images written by ``dataset``, drawn in shuffled epochs."""

    def __init__(self, folders: list[Path], seed: int) -> None:
        self.examples = [
            (folder / f"{number:06d}.jpg", rows)
            for folder in folders
            for number, rows in enumerate(read_labels(folder))
        ]
        self.rng = np.random.default_rng([seed, 12])
        self._order: list[int] = []

    def batch(self, size: Size, count: int) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """The next ``count`` examples: images (B, 3, H, W), labels (B, N), boxes (B, N, 4)."""
        windows, labels, boxes = [], [], []
        for _ in range(count):
            window, rows = self._one(size)
            targets = assign(rows[:, 2:6], rows[:, 1].astype(np.int64), rows[:, 6], size)
            windows.append(window)
            labels.append(targets.labels)
            boxes.append(targets.boxes)
        images = torch.from_numpy(np.stack(windows)).permute(0, 3, 1, 2).float()
        return images, torch.from_numpy(np.stack(labels)), torch.from_numpy(np.stack(boxes))

    def _one(self, size: Size) -> tuple[np.ndarray, F32]:
        if not self._order:
            self._order = self.rng.permutation(len(self.examples)).tolist()
        path, rows = self.examples[self._order.pop()]
        return view(self.rng, np.asarray(cv2.imread(str(path)), dtype=np.uint8), rows, size)


def train(
    folders: list[Path],
    out: Path,
    steps: int,
    minutes: float = math.inf,
    seed: int = 1,
    threads: int = 2,
    bf16: bool = False,
    rate: float = 3e-3,
    start_from: Path | None = None,
) -> None:
    """Train for ``steps`` steps or ``minutes``, whichever ends first, with a cosine schedule over that span. A
    checkpoint and an ONNX file are written ten times on the way. With ``minutes``, the result depends on the machine's
    speed. start_from: weights of an earlier training (the .pt file beside its ONNX file)."""
    torch.manual_seed(seed)
    torch.set_num_threads(threads)
    examples = Examples(folders, seed)
    network = DetectorNetwork()
    if start_from is not None:
        network.load_state_dict(torch.load(start_from))
    average = copy.deepcopy(network)
    optimiser = torch.optim.AdamW(network.parameters(), lr=rate, weight_decay=_DECAY)
    start, next_save = time.monotonic(), 0.1
    for step in range(steps):
        done = max(step / steps, (time.monotonic() - start) / (60.0 * minutes))
        if done >= 1.0:
            break
        for group in optimiser.param_groups:
            group["lr"] = rate * min(1.0, (step + 1) / _WARM_UP_STEPS) * (0.02 + 0.49 * (1 + math.cos(math.pi * done)))
        size, count = _WINDOWS[0 if examples.rng.random() < _SMALL_SHARE else 1]
        images, labels, boxes = examples.batch(size, count)
        with torch.autocast("cpu", torch.bfloat16, enabled=bf16):
            logits = network(images)
        found = losses(logits.float(), labels, boxes, size)
        optimiser.zero_grad(set_to_none=True)
        found.total.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), _CLIP)
        optimiser.step()
        _blend(average, network, min(_AVERAGE, (step + 1) / (step + 10)))
        if step % 20 == 0:
            print(
                f"{time.monotonic() - start:6.0f} s  step {step}  {100 * done:3.0f} %  loss {found.total.item():.3f}  "
                f"objectness {found.objectness:.3f}  classes {found.classes:.3f}  IoU {found.iou:.3f}",
                flush=True,
            )
        if done >= next_save:
            _save(average, out)
            next_save += 0.1
    _save(average, out)


def _blend(average: torch.nn.Module, network: torch.nn.Module, keep: float) -> None:
    """Update the exponential moving average of weights and statistics (Polyak averaging), which is more stable than the
    last step."""
    with torch.no_grad():
        for mean, now in zip(average.state_dict().values(), network.state_dict().values(), strict=True):
            if mean.dtype.is_floating_point:
                mean.lerp_(now, 1.0 - keep)


def _save(average: DetectorNetwork, out: Path) -> None:
    network = copy.deepcopy(average).eval()
    torch.save(network.state_dict(), out.with_suffix(".pt"))
    export(network, out, INPUT_SIZE)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("folders", type=Path, nargs="+")
    parser.add_argument("--steps", type=int, default=4500)
    parser.add_argument("--minutes", type=float, default=math.inf)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--bf16", action="store_true", help="mixed precision, for processors that have it")
    parser.add_argument("--rate", type=float, default=3e-3, help="learning rate at its highest")
    parser.add_argument("--start-from", type=Path, help="weights of an earlier round, a .pt file")
    train(**vars(parser.parse_args()))


if __name__ == "__main__":
    main()
