"""Metrics for Prometheus: number of frames, rates, latency, clients, and the state of the recording."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterator

from prometheus_client import CollectorRegistry, Counter, Histogram, ProcessCollector, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from app.engine.engine import Engine
from app.engine.snapshot import Snapshot
from app.streaming.stream import Stream

_WINDOW_S = 5.0
_MOST_FRAMES = 1024
_BUCKETS_S = (0.002, 0.005, 0.01, 0.02, 0.03, 0.05, 0.075, 0.1, 0.15, 0.25, 0.5, 1.0, 2.5)


class Metrics:
    """One registry per engine, so that two servers in a process do not mix their counts."""

    def __init__(self, engine: Engine, stream: Stream) -> None:
        self._registry = CollectorRegistry()
        self._sequence = 0
        self._shown_at: deque[float] = deque(maxlen=_MOST_FRAMES)
        to = self._registry
        self._frames = Counter("cipv_frames", "Results computed", registry=to)
        self._pipeline = Histogram(
            "cipv_line_seconds", "Time for one frame: all stages, without the networks", buckets=_BUCKETS_S, registry=to
        )
        self._detector = Histogram(
            "cipv_detector_seconds",
            "Detector time for one image that was not cached",
            buckets=_BUCKETS_S,
            registry=to,
        )
        self._latency = Histogram(
            "cipv_result_to_sent_seconds",
            "Time from a result to its broadcast message",
            buckets=_BUCKETS_S,
            registry=to,
        )
        self._registry.register(_Now(engine, stream, self._rate_hz))
        ProcessCollector(registry=self._registry)

    def saw(self, snapshot: Snapshot) -> None:
        """Called by the engine after the stream has received the snapshot; only new results are counted."""
        processed = snapshot.processed
        if processed is None or snapshot.sequence <= self._sequence:
            return
        self._frames.inc(snapshot.sequence - self._sequence)
        self._sequence = snapshot.sequence
        self._shown_at.append(time.monotonic())
        total_ms = processed.result.timing_ms.get("total")
        if total_ms is not None:
            self._pipeline.observe(total_ms / 1e3)
        if processed.detect_ms > 0:
            self._detector.observe(processed.detect_ms / 1e3)
        self._latency.observe(max(0.0, time.time() - snapshot.made_unix_s))

    def render(self) -> bytes:
        """In Prometheus' text format."""
        return generate_latest(self._registry)

    def _rate_hz(self) -> float:
        """Results per second, over the last seconds."""
        now = time.monotonic()
        return sum(now - t <= _WINDOW_S for t in list(self._shown_at)) / _WINDOW_S


class _Now(Collector):
    """Values that are read on request."""

    def __init__(self, engine: Engine, stream: Stream, rate_hz: Callable[[], float]) -> None:
        self._engine = engine
        self._stream = stream
        self._rate_hz = rate_hz

    def collect(self) -> Iterator[Metric]:
        shown, recording, traffic = self._engine.snapshot, self._engine.recorder.state, self._stream.traffic
        yield GaugeMetricFamily("cipv_engine_up", "1 while the worker is running", self._engine.alive)
        yield GaugeMetricFamily("cipv_frames_per_second", "Results per second, recently", self._rate_hz())
        yield GaugeMetricFamily("cipv_frames_skipped", "Frames skipped since the source was opened", shown.skipped)
        yield GaugeMetricFamily("cipv_clients", "Open streams", self._stream.clients)
        yield CounterMetricFamily("cipv_client_frames_sent", "Frames sent, over all clients", traffic.sent)
        yield CounterMetricFamily("cipv_client_frames_dropped", "Frames skipped for slow clients", traffic.dropped)
        yield GaugeMetricFamily("cipv_recording", "1 while recording", recording is not None and not recording.error)
        yield GaugeMetricFamily("cipv_recording_bytes", "Bytes of this recording", recording.bytes if recording else 0)
        yield GaugeMetricFamily(
            "cipv_recording_frames", "Frames of this recording", recording.frames if recording else 0
        )
        yield GaugeMetricFamily(
            "cipv_recording_frames_dropped",
            "Frames and messages dropped because the disk or the machine was too slow",
            recording.dropped if recording else 0,
        )
