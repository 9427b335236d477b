"""Captures of network traffic (pcap, pcapng) with a VLP-16's packets in them."""

from __future__ import annotations

from pipeline.sources.pcap.source import PcapSource

__all__ = ["PcapSource"]
