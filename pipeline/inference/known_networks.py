"""The networks known by name, and where to download or export each of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Task = Literal["detector", "lanes"]


@dataclass(frozen=True)
class KnownModel:
    """A network that can be downloaded, or that can be exported from a project."""

    name: str
    """As in ``cipv models pull NAME``."""
    task: Task
    """What it detects."""
    url: str
    """Of the file, or of the project."""
    size: int | None
    """Bytes; None if there is no official file: the user downloads or exports one and registers it."""
    sha256: str | None
    """Of the official file."""
    licence: str
    """Of the weights."""
    note: str
    """For display."""

    @property
    def remedy(self) -> str:
        """How to install it."""
        if self.size is not None:
            return f"`cipv models pull {self.name}` ({self.size / 1e6:.1f} MB)"
        return f"download or export its ONNX file, then {self.register}"

    @property
    def register(self) -> str:
        """The command that installs a file downloaded manually."""
        task = "" if self.task == "detector" else f" --task {self.task}"
        return f"`cipv models register PATH {self.name}{task}`"


_YOLOX = "https://github.com/Megvii-BaseDetection/YOLOX/releases/download/0.1.1rc0/"
KNOWN: tuple[KnownModel, ...] = (
    KnownModel(
        "yolox_nano", "detector", _YOLOX + "yolox_nano.onnx", 3_659_407,
        "c789161ed43c8269fcd4e67c67eeeb4e80c622da2eb296a20bc6007bd18a0b7d",
        "Apache-2.0", "COCO, 0.9 M parameters: about 10 ms per image on one core",
    ),
    KnownModel(
        "yolox_tiny", "detector", _YOLOX + "yolox_tiny.onnx", 20_219_662,
        "427cc366d34e27ff7a03e2899b5e3671425c262ea2291f88bb942bc1cc70b0f7",
        "Apache-2.0", "COCO, 5 M parameters",
    ),
    KnownModel(
        "yolox_s", "detector", _YOLOX + "yolox_s.onnx", 35_858_002,
        "c5c2d13e59ae883e6af3b45daea64af4833a4951c92d116ec270d9ddbe998063",
        "Apache-2.0", "COCO, 9 M parameters; best on a GPU",
    ),
    KnownModel(
        "twinlitenet", "lanes", "https://github.com/harrylal/TwinLiteNet-onnx-opencv-dnn/raw/main/models/best.onnx",
        1_800_549, "f505b56bd7c9e4e38b2928373aa4daa191a9a398e07e1fb340024b9ce84d4285",
        "MIT", "BDD100K, lane lines and drivable area",
    ),
    KnownModel(
        "twinlitenetplus_small", "lanes", "https://github.com/chequanghuy/TwinLiteNetPlus", None, None,
        "MIT", "BDD100K, lane lines and drivable area, twice as fast as TwinLiteNet; export it to ONNX",
    ),
    KnownModel(
        "lstr_360x640", "lanes", "https://github.com/liuruijin17/LSTR", None, None,
        "BSD-3-Clause", "TuSimple, motorways: lines as curves, 14 times as fast as TwinLiteNet; export it to ONNX",
    ),
    KnownModel(
        "yolop", "lanes", "https://github.com/hustvl/YOLOP", None, None,
        "MIT", "BDD100K, lane lines, drivable area and cars; its weights/ folder has ONNX files",
    ),
    KnownModel(
        "ufld", "lanes", "https://github.com/cfzd/Ultra-Fast-Lane-Detection", None, None,
        "MIT", "CULane or TuSimple, up to four lines; export it to ONNX",
    ),
    KnownModel(
        "enet_sad", "lanes", "https://github.com/InhwanBae/ENet-SAD_Pytorch", None, None,
        "MIT", "BDD100K or CULane, the paper's network; export it to ONNX",
    ),
)  # fmt: skip
