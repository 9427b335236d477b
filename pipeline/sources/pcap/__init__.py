"""Captures of network traffic (pcap, pcapng) that contain a VLP-16's packets."""

from __future__ import annotations

from pipeline.sources.pcap.source import PcapSource

__all__ = ["PcapSource"]
