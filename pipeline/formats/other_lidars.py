"""Packets of LiDARs that are not decoded here: whose they are, so that the error can say what to do.

No package that decodes Hesai's or RoboSense's packets in Python is kept well. Ouster's own, ouster-sdk, pins versions
of rosbags, click and flask that the product cannot share, and needs a metadata file beside the capture.
"""

from __future__ import annotations

_OUSTER_PORT = 7502
_OUSTER_BYTES = (3392, 6464, 12608, 24896)
"""Of the legacy profile with 16, 32, 64 and 128 beams."""
_BEGINS: tuple[tuple[bytes, str], ...] = (
    (b"\x55\xaa\x05\x0a", "RoboSense"),
    (b"\x55\xaa\x05\x5a", "RoboSense"),
    (b"\xee\xff", "Hesai"),
)
_PANDAR40_BYTES = (1256, 1262)


def maker_of(payload: bytes, port: int, length: int) -> str | None:
    """Manufacturer of the LiDAR that sent a datagram; None if unknown. payload: its beginning, if it was fragmented;
    length: of the whole."""
    if port == _OUSTER_PORT or length in _OUSTER_BYTES:
        return "Ouster"
    if payload[:2] == b"\xff\xee" and length in _PANDAR40_BYTES:
        return "Hesai"
    return next((maker for begin, maker in _BEGINS if payload.startswith(begin)), None)


def about_maker(maker: str) -> str:
    """What to do with a recording of its packets."""
    return (
        f"packets of a LiDAR by {maker}, which are not decoded here; convert them with the maker's tools or ROS driver "
        "to a ROS bag of PointCloud2, or to PCD files, one per sweep"
    )
