"""PCD files in every encoding."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np

from pipeline.types import Sweep
from tests.pipeline.formats.velodyne.streams import ring_wall

DTYPE = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4"), ("ring", "<u2"), ("time", "<f4")])
STAMPS_NS = (1_700_000_000_000_000_000, 1_700_000_000_100_000_000)


def rows_of(sweep: Sweep) -> np.ndarray[Any, np.dtype[np.void]]:
    rows = np.zeros(len(sweep.points), DTYPE)
    for index, name in enumerate(("x", "y", "z", "intensity")):
        rows[name] = sweep.points[:, index]
    rows["ring"], rows["time"] = sweep.ring, np.linspace(-0.05, 0.05, len(rows))
    return rows


def pcd(rows: np.ndarray[Any, np.dtype[np.void]], encoding: str = "binary") -> bytes:
    kinds = [rows.dtype[name].kind.upper() for name in rows.dtype.names or ()]
    sizes = [str(rows.dtype[name].itemsize) for name in rows.dtype.names or ()]
    head = [
        "# .PCD v0.7 - Point Cloud Data file format",
        "VERSION 0.7",
        f"FIELDS {' '.join(rows.dtype.names or ())}",
        f"SIZE {' '.join(sizes)}",
        f"TYPE {' '.join(kinds)}",
        f"COUNT {' '.join('1' for _ in sizes)}",
        f"WIDTH {len(rows)}",
        "HEIGHT 1",
        "VIEWPOINT 0 0 0 1 0 0 0",
        f"POINTS {len(rows)}",
        f"DATA {encoding}",
    ]
    if encoding == "ascii":
        body = "".join(" ".join(repr(value.item()) for value in row) + "\n" for row in rows).encode()
    elif encoding == "binary":
        body = rows.tobytes()
    else:
        flat = b"".join(rows[name].tobytes() for name in rows.dtype.names or ())
        packed = lzf(flat)
        body = len(packed).to_bytes(4, "little") + len(flat).to_bytes(4, "little") + packed
    return "\n".join(head).encode() + b"\n" + body


def lzf(data: bytes) -> bytes:
    """LZF compression: literals, and runs of one byte as back-references by one byte."""
    out, literals, at = bytearray(), bytearray(), 0

    def flush() -> None:
        for begin in range(0, len(literals), 32):
            part = literals[begin : begin + 32]
            out.append(len(part) - 1)
            out.extend(part)
        literals.clear()

    while at < len(data):
        run = 1
        while run < 264 and at + run < len(data) and data[at + run] == data[at]:
            run += 1
        literals.append(data[at])
        at += 1
        if run >= 4:
            flush()
            length = run - 1
            out += bytes([(length - 2) << 5]) if length < 9 else bytes([7 << 5, length - 9])
            out.append(0)  # distance: one byte back
            at += length
    flush()
    return bytes(out)


def write_clouds(folder: Path, encoding: str = "binary") -> Path:
    """Write two sweeps named by their times, and their images."""
    (folder / "images").mkdir(parents=True)
    for index, stamp in enumerate(STAMPS_NS):
        rows = rows_of(ring_wall(0, 10.0 - index))[:: 1 if encoding != "ascii" else 20]
        (folder / f"{stamp}.pcd").write_bytes(pcd(rows, encoding))
        cv2.imwrite(str(folder / "images" / f"{stamp}.png"), np.full((48, 80, 3), 50 + index, np.uint8))
    return folder
