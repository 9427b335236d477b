"""PCD files (Point Cloud Library's format, version 0.7): ASCII, binary and binary_compressed, with all their fields.

Read here because Open3D's usual reader drops rings, intensities and times, and needs graphics libraries that a slim
system lacks.
"""

from __future__ import annotations

import io
from typing import NamedTuple

import numba
import numpy as np
import numpy.typing as npt

from pipeline.formats.point_cloud_fields import MOST_POINTS
from pipeline.types.source import SourceError

_TYPES = {
    ("F", 4): "f4",
    ("F", 8): "f8",
    **{(kind, size): f"{kind.lower()}{size}" for kind in "IU" for size in (1, 2, 4, 8)},
}
_MAX_HEADER = 8192
_LINES = ("VERSION", "FIELDS", "SIZE", "TYPE", "COUNT", "WIDTH", "HEIGHT", "VIEWPOINT", "POINTS", "DATA")

PointRows = npt.NDArray[np.void]


class _Header(NamedTuple):
    dtype: np.dtype[np.void]
    points: int
    data: str
    begins: int


def parse_pcd(data: bytes, name: str, notes: list[str]) -> PointRows:
    """The points as a structured array. A file that is cut off gives the points before the cut, and ``notes`` says so.
    SourceError, naming the file, when it is no PCD file or holds no point."""
    header = _header(data, name)
    body = data[header.begins :]
    if header.data == "ascii":
        rows = _ascii(body, header, name)
    elif header.data == "binary":
        whole = min(header.points, len(body) // header.dtype.itemsize)
        rows = np.frombuffer(body, header.dtype, count=whole)
    else:
        rows = _compressed(body, header, name)
    if not len(rows):
        raise SourceError(f"{name}: no points")
    if len(rows) < header.points:
        notes.append(f"{name}: {len(rows)} of {header.points} points read")
    return rows


def _header(data: bytes, name: str) -> _Header:
    lines: dict[str, list[str]] = {}
    at = 0
    while "DATA" not in lines:
        end = data.find(b"\n", at, _MAX_HEADER)
        if end < 0:
            raise SourceError(f"{name}: not a PCD file: its header does not end")
        words = data[at:end].decode("ascii", "replace").split()
        at = end + 1
        if words and not words[0].startswith("#"):
            if words[0] not in _LINES:
                raise SourceError(f"{name}: not a PCD file")
            lines[words[0]] = words[1:]
    try:
        return _Header(_dtype(lines), _points(lines), _encoding(lines), at)
    except (KeyError, ValueError, IndexError):
        raise SourceError(f"{name}: its header is invalid") from None


def _dtype(lines: dict[str, list[str]]) -> np.dtype[np.void]:
    """Fields with more than one value or without a name are room that is passed over."""
    fields, sizes, kinds = lines["FIELDS"], [int(size) for size in lines["SIZE"]], lines["TYPE"]
    counts = [int(count) for count in lines.get("COUNT", ["1"] * len(fields))]
    if not fields or not len(fields) == len(sizes) == len(kinds) == len(counts):
        raise ValueError("unequal lists")
    parts: list[tuple[str, str, tuple[int, ...]]] = []
    for index, (field, size, kind, count) in enumerate(zip(fields, sizes, kinds, counts, strict=True)):
        if not 0 < count <= 4096:
            raise ValueError("a field without a size")
        taken = field == "_" or any(field == other for other, _, _ in parts)
        plain = "<" + _TYPES[kind, size]
        parts.append((f"_{index}" if taken else field, plain, () if count == 1 else (count,)))
    return np.dtype(parts)


def _points(lines: dict[str, list[str]]) -> int:
    points = int(lines["POINTS"][0]) if "POINTS" in lines else int(lines["WIDTH"][0]) * int(lines["HEIGHT"][0])
    if not 0 <= points <= MOST_POINTS:
        raise ValueError("an invalid number of points")
    return points


def _encoding(lines: dict[str, list[str]]) -> str:
    data = lines["DATA"][0].lower()
    if data not in ("ascii", "binary", "binary_compressed"):
        raise ValueError("unknown data")
    return data


def _ascii(body: bytes, header: _Header, name: str) -> PointRows:
    """Rows of numbers; the first that is none ends it."""
    columns = sum(int(np.prod(header.dtype[field].shape, dtype=int)) for field in header.dtype.names or ())
    good: list[list[float]] = []
    for line in io.BytesIO(body):
        words = line.split()
        try:
            row = [float(word) for word in words]
        except ValueError:
            break
        if len(row) != columns or len(good) == header.points:
            break
        good.append(row)
    numbers = np.array(good, dtype=np.float64).reshape(-1, columns)
    rows = np.zeros(len(good), header.dtype)
    at = 0
    for field in header.dtype.names or ():
        shape = header.dtype[field].shape
        width = int(np.prod(shape, dtype=int))
        base = header.dtype[field].base
        values = numbers[:, at : at + width]
        if np.issubdtype(base, np.integer):
            limits = np.iinfo(base)
            values = np.clip(np.nan_to_num(values), float(limits.min), min(float(limits.max), 2.0**53))
        with np.errstate(over="ignore"):
            rows[field] = values.astype(base).reshape((len(good), *shape))
        at += width
    return rows


def _compressed(body: bytes, header: _Header, name: str) -> PointRows:
    """LZF, field after field (all x, then all y, …)."""
    expected = header.points * header.dtype.itemsize
    if len(body) < 8:
        raise SourceError(f"{name}: the file is truncated")
    packed, unpacked = (int(value) for value in np.frombuffer(body, "<u4", count=2))
    if unpacked != expected or len(body) < 8 + packed:
        raise SourceError(f"{name}: the file is truncated or damaged")
    flat = np.zeros(unpacked, dtype=np.uint8)
    if _unpack_lzf(np.frombuffer(body, np.uint8, count=packed, offset=8), flat) != unpacked:
        raise SourceError(f"{name}: its compressed points are damaged")
    rows, at = np.zeros(header.points, header.dtype), 0
    for field in header.dtype.names or ():
        width = header.dtype[field].itemsize * header.points
        part = flat[at : at + width].view(header.dtype[field].base)
        rows[field] = part.reshape((header.points, *header.dtype[field].shape))
        at += width
    return rows


@numba.njit(cache=True, nogil=True)
def _unpack_lzf(packed: npt.NDArray[np.uint8], out: npt.NDArray[np.uint8]) -> int:  # pragma: no cover
    """LZF (Marc Lehmann's LibLZF): a control byte below 32 is followed by that many bytes and one; else its upper three
    bits are a length and its lower five the high bits of how far back to copy from. Bytes written, −1 for damage."""
    read, written = 0, 0
    while read < packed.size:
        control = int(packed[read])
        read += 1
        if control < 32:
            count = control + 1
            if read + count > packed.size or written + count > out.size:
                return -1
            for k in range(count):
                out[written + k] = packed[read + k]
            read += count
        else:
            count = control >> 5
            if count == 7:
                if read >= packed.size:
                    return -1
                count += int(packed[read])
                read += 1
            if read >= packed.size:
                return -1
            source = written - ((control & 0x1F) << 8) - int(packed[read]) - 1
            read += 1
            count += 2
            if source < 0 or written + count > out.size:
                return -1
            for k in range(count):
                out[written + k] = out[source + k]
        written += count
    return written
