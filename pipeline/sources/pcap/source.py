"""A capture of a Velodyne's packets as a recording: one pass over the file finds its sweeps; each is decoded on demand.

Only a sweep's time and the positions of its first and last packet in the file are kept, so memory use hardly depends on
the length of a recording. GNSS comes from a file of sentences beside it, or else from the sensor's own position
packets.
"""

from __future__ import annotations

from array import array
from collections import Counter
from collections.abc import Iterator
from itertools import islice

import numpy as np

from pipeline.common.fast_replace import evolve
from pipeline.common.progress import Progress, silent
from pipeline.formats.file_reading import recording_file
from pipeline.formats.nmea import NmeaReader
from pipeline.formats.other_lidars import about_maker, maker_of
from pipeline.formats.velodyne import (
    PACKET_BYTES,
    POSITION_BYTES,
    VLP16,
    BadPacket,
    Rotation,
    RotationCutter,
    SensorClock,
    VelodyneDecoder,
    VelodyneModel,
    about_other_models,
    about_supported_models,
    model_of,
    read_position,
)
from pipeline.sources.pcap.capture import Capture, Datagram
from pipeline.sources.sidecar_files import OPTIONS, Beside, rig_of
from pipeline.sources.uri_options import number_option, split_options
from pipeline.types import F64, Frame, GnssFix, Sweep
from pipeline.types.source import Opening, SourceError, TruthObject

_DATA_PORT = 2368
_LOOK_AT = 2000
"""Number of datagrams at the beginning used to detect the LiDAR's port."""
_TELL_EVERY = 4 << 20
"""Bytes between two progress reports."""
_NMEA = slice(0xCA, 0x14E)  # PPS state and sentence of a position packet


def open_recording(uri: str, rest: str, how: Opening) -> PcapSource:
    """Loaded by name from ``pipeline.source_kinds``. SourceError if it cannot be opened."""
    return PcapSource(uri, rest, how.progress)


class PcapSource:
    """``<file>?port=2368&video=…&video_offset_s=…&nmea=…&rig=…``, all optional."""

    def __init__(self, uri: str, rest: str, progress: Progress = silent) -> None:
        path, options = split_options(rest, ("port", *OPTIONS))
        file = recording_file(path)
        self.uri, self.title = uri, file.stem
        self._capture = Capture(file)
        rig = rig_of(file, options)
        self.T_ego_lidar = rig.lidar.mount.T_ego_sensor()
        self._port = int(number_option(options, "port", 0)) or _lidar_port(self._capture)
        self._model = model_of(each.payload for each in self._capture.datagrams() if each.port == self._port)
        self._index = _Index(self._capture, self._port, self.T_ego_lidar, self._model, progress)
        if not len(self._index):
            raise SourceError(f"{file.name}: {self._index.about_nothing(self._port)}")
        self._beside = Beside(file, options, rig, self._index.begin_ns, self._index.fixes, progress)
        self.rate_hz = self._index.rate_hz()
        self.notes = (*self._index.about(), *self._beside.notes)

    def __len__(self) -> int:
        return len(self._index)

    def t_ns(self, index: int) -> int:
        """When the sensor head faced straight ahead: UTC if the sensor follows GPS, else by the capturing host's
        clock."""
        if not 0 <= index < len(self):
            raise IndexError(f"frame {index} of {len(self)}")
        return self._index.times_ns[index]

    def frame(self, index: int) -> Frame:
        t_ns = self.t_ns(index)
        notes: list[str] = []
        return self._beside.frame(index, t_ns, self._sweep(index, notes), notes)

    def outlines(self) -> Iterator[Frame]:
        return self._beside.outlines(self._index.times_ns)

    def sweep(self, index: int) -> Sweep | None:
        self.t_ns(index)
        return self._sweep(index, [])

    def packets(self) -> Iterator[tuple[int, bytes]]:
        """Every data and position packet of the LiDAR as captured: time (unix ns) and payload."""
        for datagram in self._capture.datagrams():
            if datagram.port == self._port or len(datagram.payload) == POSITION_BYTES:
                yield datagram.t_ns, datagram.payload

    def truth(self, index: int) -> tuple[TruthObject, ...] | None:
        self.t_ns(index)
        return None

    def _sweep(self, index: int, notes: list[str]) -> Sweep | None:
        """Decoded from its part of the file, which may also contain the ends of neighbouring sweeps."""
        decoder = VelodyneDecoder(self.T_ego_lidar, keeps_partial=True, model=self._model)
        found = list[Sweep | None]()
        try:
            for datagram in self._capture.datagrams(self._index.first[index], self._index.last[index]):
                if datagram.port == self._port:
                    found.append(decoder.push(datagram.payload, datagram.t_ns))
        except SourceError as error:
            notes.append(str(error))
            return None
        sweep = max((*found, decoder.flush()), key=lambda sweep: len(sweep.points) if sweep is not None else 0)
        counts = decoder.counts
        if counts.refused:
            notes.append(f"LiDAR: {counts.about_refused()}")
        if counts.lost:
            notes.append(f"LiDAR: {counts.lost} packets lost")
        if sweep is None:
            notes.append("no LiDAR points in this sweep")
        return None if sweep is None else evolve(sweep, t_ns=self._index.times_ns[index])


class _Index:
    """Positions of all complete sweeps. first, last: offsets of the first and last record of each. fixes: from the
    position packets."""

    def __init__(self, capture: Capture, port: int, T_ego_lidar: F64, model: VelodyneModel, progress: Progress) -> None:
        self.first, self.last, self.times_ns = array("q"), array("q"), array("q")
        self.fixes: list[GnssFix] = []
        self.begin_ns = 0
        self._clock, self._sentences = SensorClock(), NmeaReader()
        self._cutter = RotationCutter(T_ego_lidar, self._clock, model=model)
        self._said = b""
        self._capture = capture
        told = 0
        for datagram in capture.datagrams():
            if datagram.origin >= told:
                told = datagram.origin + _TELL_EVERY
                progress(datagram.origin, capture.size)
            if datagram.port == port:
                self.begin_ns = self.begin_ns or datagram.t_ns
                self._add(self._cutter.push(datagram.payload, datagram.t_ns, datagram.origin))
            elif len(datagram.payload) == POSITION_BYTES and datagram.payload[_NMEA] != self._said:
                self._position(datagram)
        self._add(self._cutter.flush())
        self._keep(self._sentences.flush(self.begin_ns), self.begin_ns)

    def __len__(self) -> int:
        return len(self.times_ns)

    def rate_hz(self) -> float:
        steps = np.diff(np.frombuffer(self.times_ns, dtype=np.int64))
        return round(1e9 / float(np.median(steps)), 2) if len(steps) and np.median(steps) > 0 else 10.0

    def about(self) -> list[str]:
        """What a user should know about the whole file."""
        counts = self._cutter.counts
        says = {
            "gps": "LiDAR times are UTC: the sensor is synchronised to GPS",
            "host": "LiDAR times count from the host's capture time; the sensor is not synchronised to GPS",
            "sensor": "LiDAR times count from the full hour of the sensor's own clock",
        }
        notes = [] if self._cutter.model is VLP16 else [f"LiDAR: Velodyne {self._cutter.model.name}"]
        notes += [says[self._clock.reference]]
        notes += [counts.about_refused()] if counts.refused else []
        notes += [f"{counts.lost} packets lost"] if counts.lost else []
        notes += [f"the file is {self._capture.damage}"] if self._capture.damage else []
        return notes

    def about_nothing(self, port: int) -> str:
        """Why it contains no sweep."""
        counts = self._cutter.counts
        if counts.models:
            return about_other_models(counts.models)
        others = Counter(
            maker_of(begin, to, length) for to, length, begin in islice(self._capture.beginnings(), _LOOK_AT)
        )
        maker = next((maker for maker, _ in others.most_common() if maker is not None), None)
        if maker is not None:
            return about_maker(maker)
        says = [f"no complete sweep in {counts.packets} packets to port {port}"] if counts.packets else []
        says = says or [f"no Velodyne packets to port {port}"]
        if not counts.packets:
            says += [self._about_other_ports()]
        says += [counts.about_refused(), about_supported_models()] if counts.refused else []
        says += [f"the file is {self._capture.damage}"] if self._capture.damage else []
        return "; ".join(says)

    def _about_other_ports(self) -> str:
        """The ports to which most of the first datagrams are sent."""
        ports = Counter(to for to, _, _ in islice(self._capture.beginnings(), _LOOK_AT))
        if not ports:
            return "it holds no UDP datagrams"
        return f"its UDP datagrams go to {', '.join(f'port {port}' for port, _ in ports.most_common(3))}"

    def _add(self, rotation: Rotation | None) -> None:
        if rotation is None:
            return
        origins = [placed.origin for placed in rotation.packets]
        self.first.append(min(origins))
        self.last.append(max(origins))
        self.times_ns.append(max(rotation.t_ns, self.times_ns[-1] + 1 if self.times_ns else rotation.t_ns))

    def _position(self, datagram: Datagram) -> None:
        """Process a position packet with new content: the clock's reference, and the sensor's position."""
        self._said = datagram.payload[_NMEA]
        try:
            position = read_position(datagram.payload)
        except BadPacket:
            return
        self._clock.follow_gps(position.locked)
        self._keep(self._sentences.push(position.nmea, datagram.t_ns), datagram.t_ns)

    def _keep(self, fix: GnssFix | None, t_host_ns: int) -> None:
        """A fix has UTC time; if the LiDAR's times are the host's, the time at which the host received it is used."""
        if fix is not None:
            self.fixes.append(fix if self._clock.reference == "gps" else evolve(fix, t_ns=t_host_ns))


def _lidar_port(capture: Capture) -> int:
    """The port to which most datagrams with the length of a LiDAR packet are sent; the default port if there are
    none."""
    ports: Counter[int] = Counter()
    for count, datagram in enumerate(capture.datagrams()):
        if len(datagram.payload) == PACKET_BYTES:
            ports[datagram.port] += 1
        if count == _LOOK_AT:
            break
    return _DATA_PORT if not ports or _DATA_PORT in ports else ports.most_common(1)[0][0]
