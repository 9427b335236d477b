"""Synthetic captures: classic pcap and pcapng, with Ethernet frames that contain UDP datagrams."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from pathlib import Path

import av
import numpy as np

from tests.pipeline.formats.velodyne.streams import START_NS, drive

Datagrams = Iterable[tuple[int, int, bytes]]
"""Capture time (ns), port, payload."""


def ethernet(port: int, payload: bytes, vlan: bool = False, version: int = 4, kind: int = 17) -> bytes:
    udp = struct.pack(">HHHH", 1000, port, 8 + len(payload), 0) + payload
    if version == 4:
        ip = struct.pack(">BBHHHBBH8s", 0x45, 0, 20 + len(udp), 0, 0, 64, kind, 0, bytes(8)) + udp
    else:
        ip = struct.pack(">IHBB32s", 6 << 28, len(udp), kind, 64, bytes(32)) + udp
    tag = struct.pack(">HH", 0x8100, 5) if vlan else b""
    return bytes(12) + tag + struct.pack(">H", 0x0800 if version == 4 else 0x86DD) + ip


def pcap(datagrams: Datagrams, order: str = "<", nano: bool = False, link: int = 1) -> bytes:
    magic = 0xA1B23C4D if nano else 0xA1B2C3D4
    parts = [struct.pack(order + "IHHIIII", magic, 2, 4, 0, 0, 65535, link)]
    for t_ns, port, payload in datagrams:
        frame = ethernet(port, payload) if link == 1 else bytes({113: 16, 101: 0}[link]) + ethernet(port, payload)[14:]
        ticks = t_ns % 10**9 // (1 if nano else 1000)
        parts.append(struct.pack(order + "IIII", t_ns // 10**9, ticks, len(frame), len(frame)) + frame)
    return b"".join(parts)


def pcapng(datagrams: Datagrams, order: str = "<", nano: bool = True, interface: int = 0) -> bytes:
    """A pcapng file. interface: number of the interface with the datagrams; those before it are raw IP and without
    packets."""

    def block(kind: int, body: bytes) -> bytes:
        body += bytes(-len(body) % 4)
        length = 12 + len(body)
        return struct.pack(order + "II", kind, length) + body + struct.pack(order + "I", length)

    resolution = struct.pack(order + "HHB3x", 9, 1, 9) if nano else b""
    parts = [
        block(0x0A0D0D0A, struct.pack(order + "IHHq", 0x1A2B3C4D, 1, 0, -1)),
        *[block(1, struct.pack(order + "HHI", 101, 0, 65535) + bytes(4))] * interface,
        block(1, struct.pack(order + "HHI", 1, 0, 65535) + resolution + bytes(4)),
    ]
    for t_ns, port, payload in datagrams:
        frame, ticks = ethernet(port, payload), t_ns if nano else t_ns // 1000
        head = struct.pack(order + "IIIII", interface, ticks >> 32, ticks & 0xFFFFFFFF, len(frame), len(frame))
        parts.append(block(6, head + frame))
    return b"".join(parts)


def lidar(sweeps: int, port: int = 2368) -> list[tuple[int, int, bytes]]:
    return [(t_ns, port, packet) for packet, t_ns in drive(sweeps)]


def write_capture(folder: Path) -> Path:
    """Write a folder with a capture of three sweeps and its sidecar files: a video, NMEA sentences and a rig file."""
    folder.mkdir(parents=True)
    (folder / "drive.pcap").write_bytes(pcap(lidar(3), nano=True))
    write_video(folder / "drive.avi", 8)
    (folder / "drive.nmea").write_text("".join(sentences(range(4))), encoding="ascii")
    (folder / "drive.yaml").write_text(RIG, encoding="utf-8")
    return folder


RIG = """
lidar: {mount: {z_m: 1.0}}
camera:
  calibration: {fx_px: 60, fy_px: 60, cx_px: 40, cy_px: 24, width_px: 80, height_px: 48, mount: {z_m: 1.2}}
"""


def write_video(path: Path, images: int, rate: int = 25, codec: str = "mjpeg", step: int = 20, gop: int = 0) -> None:
    """A video of 80×48 px; the grey level of each image is ``step`` times its number. gop: images from one key image to
    the next; 0 for the encoder's own."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=rate)
        stream.width, stream.height, stream.pix_fmt = 80, 48, "yuvj420p" if codec == "mjpeg" else "yuv420p"
        if gop:
            stream.codec_context.gop_size = gop
        for number in range(images):
            grey = np.full((48, 80, 3), step * number, dtype=np.uint8)
            container.mux(stream.encode(av.VideoFrame.from_ndarray(grey, format="bgr24")))
        container.mux(stream.encode())


def sentences(seconds: Iterable[int]) -> list[str]:
    """GGA and RMC once per second from the start of the capture, moving north at 10 m/s."""
    lines = []
    for second in seconds:
        at = START_NS // 10**9 - 1 + second
        clock = f"{at // 3600 % 24:02d}{at // 60 % 60:02d}{at % 60:02d}.00"
        north = f"{47.0 + second * 10 / 1852:.6f}"
        for body in (
            f"GPGGA,{clock},48{north},N,00900.000000,E,4,12,0.6,500.0,M,48.0,M,,",
            f"GPRMC,{clock},A,48{north},N,00900.000000,E,19.438,0.0,141123,,,D",
        ):
            checksum = 0
            for character in body.encode():
                checksum ^= character
            lines.append(f"${body}*{checksum:02X}\r\n")
    return lines
