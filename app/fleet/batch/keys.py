"""What identifies a run: code, parameters, networks. Equal keys and recordings give equal bytes."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from pipeline.common.files.data_dir import file_sha256
from pipeline.detection import DetectorChoice
from pipeline.inference.distance_laws import law_file
from pipeline.inference.model_registry import EMBEDDED, default_model, find
from pipeline.params import Params
from pipeline.run import Sensors

_ROOT = Path(__file__).resolve().parents[3]
_CODE = (
    "pipeline/**/*.py",
    "pipeline/simulation/**/*.yaml",
    "pipeline/simulation/**/*.json",
    "app/drive/**/*.py",
    "app/fleet/batch/*.py",
)
"""The code that determines the content of a batch's tables."""
_LIBRARIES = ("numpy", "scipy", "numba", "opencv-python-headless", "onnxruntime", "kiss-icp", "pyarrow")


@cache
def code_digest() -> str:
    """Digest of the code that computes results and of the libraries it uses, 12 characters."""
    digest = hashlib.sha256()
    for pattern in _CODE:
        for file in sorted(_ROOT.glob(pattern)):
            digest.update(f"{file.relative_to(_ROOT)}\0".encode())
            digest.update(file.read_bytes())
    for name in _LIBRARIES:
        digest.update(f"{name} {_version(name)}\0".encode())
    return digest.hexdigest()[:12]


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return ""


def networks_digest(choice: DetectorChoice) -> str:
    """Digest of the networks that a choice selects on this machine, by their content, 12 characters."""
    named = [
        (find(choice.boxes) if choice.boxes is not None else None) or choice.boxes,
        (find(choice.lanes) if choice.lanes is not None else None) or choice.lanes,
        default_model("detector"),
        default_model("lanes"),
        find(EMBEDDED),
    ]
    found = [_content(each) if isinstance(each, Path) else each for each in named]
    options = {"lanes_every": choice.lanes_every, "far_px": choice.far_px}
    return hashlib.sha256(json.dumps([found, options]).encode()).hexdigest()[:12]


@cache
def _content(path: Path) -> list[str]:
    law = law_file(path)
    return [file_sha256(path), file_sha256(law) if law.is_file() else ""]


@dataclass(frozen=True)
class RunKey:
    """Properties shared by all drives of one run."""

    code: str
    """``code_digest``."""
    networks: str
    """``networks_digest``."""
    params: Params
    """Of the pipeline."""
    sensors: Sensors
    """Which sensors the car has."""
    rings: int
    """Rings that are kept of a LiDAR with more."""

    @property
    def name(self) -> str:
        """The run's name in tables, 12 characters."""
        made_from = [self.code, self.networks, self.params.model_dump(mode="json"), self.sensors, self.rings]
        return hashlib.sha256(json.dumps(made_from, sort_keys=True).encode()).hexdigest()[:12]

    def to_json(self, choice: DetectorChoice) -> dict[str, object]:
        """For information, and to continue the run."""
        return {
            "run": self.name,
            "code": self.code,
            "networks": self.networks,
            "sensors": self.sensors,
            "rings": self.rings,
            "choice": asdict(choice),
            "params": self.params.model_dump(mode="json"),
        }
