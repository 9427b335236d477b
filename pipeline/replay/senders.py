"""Sends each sensor's messages to the addresses that the live configuration listens on."""

from __future__ import annotations

import contextlib
import socket
import struct
import threading
from typing import Any, Protocol
from urllib.parse import urlsplit

import can

from pipeline.common.errors import BadInput
from pipeline.formats.velodyne import PACKET_BYTES, POSITION_BYTES
from pipeline.replay.camera_server import CameraServer
from pipeline.replay.nmea_writer import sentences
from pipeline.sources.live.config import CanConfig, GnssConfig, LidarConfig, LiveConfig, SignalConfig
from pipeline.sources.live.devices.can import load_dbc
from pipeline.sources.live.health import Sensor
from pipeline.types import EgoState, GnssFix

_LOOPBACK = "127.0.0.1"
_EVERY = "0.0.0.0"
_HOUR_NS = 3_600_000_000_000
_STAMP_AT = 1200
"""Offset of the time stamp in a data packet."""


class Sender(Protocol):
    """Output of one sensor. Unplugged: connections are closed and refused until it is plugged in again."""

    def send(self, payload: Any, stamp_ns: int) -> None: ...

    def plug(self, is_in: bool) -> None: ...

    def close(self) -> None: ...


def open_senders(config: LiveConfig) -> dict[Sensor, Sender]:
    """A sender for each configured sensor that can be simulated. BadInput if one cannot be opened."""
    senders: dict[Sensor, Sender] = {}
    if config.lidar is not None:
        senders["lidar"] = LidarSender(config.lidar)
    if config.camera is not None and config.camera.url is not None:
        senders["camera"] = CameraSender(config.camera.url)
    elif config.camera is not None:
        raise BadInput("camera: replay needs a camera with a url, such as http://127.0.0.1:PORT/")
    if config.gnss is not None:
        senders["gnss"] = _gnss_sender(config.gnss)
    if config.ego is not None and config.ego.can is not None:
        senders["ego"] = CanSender(config.ego.can)
    return senders


class LidarSender:
    """Data and position packets over UDP; a data packet's timestamp is set as by the sensor, µs past the hour."""

    def __init__(self, config: LidarConfig) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._host = config.multicast_group or _here(config.interface)
        self._data_port, self._position_port = config.data_port, config.position_port or config.data_port
        if config.multicast_group is not None:
            self._socket.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton(config.interface))
            self._socket.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)

    def send(self, payload: bytes, stamp_ns: int) -> None:
        if len(payload) == PACKET_BYTES:
            stamp = struct.pack("<I", stamp_ns % _HOUR_NS // 1000)
            payload = payload[:_STAMP_AT] + stamp + payload[_STAMP_AT + 4 :]
        with contextlib.suppress(OSError):  # nobody listens: a sensor sends anyway
            port = self._position_port if len(payload) == POSITION_BYTES else self._data_port
            self._socket.sendto(payload, (self._host, port))

    def plug(self, is_in: bool) -> None:
        pass

    def close(self) -> None:
        self._socket.close()


class CameraSender:
    """JPEG images over HTTP (multipart), as a network camera serves them."""

    def __init__(self, url: str) -> None:
        parts = urlsplit(url)
        if parts.scheme != "http" or parts.hostname is None:
            raise BadInput(f"camera: {url}: replay sends over http only")
        self._server = CameraServer(parts.hostname, parts.port or 80)

    def send(self, payload: bytes, stamp_ns: int) -> None:
        self._server.send(payload, stamp_ns)

    def plug(self, is_in: bool) -> None:
        if is_in:
            self._server.plug_in()
        else:
            self._server.unplug()

    def close(self) -> None:
        self._server.unplug()


class UdpNmeaSender:
    """NMEA sentences over UDP, one datagram per fix."""

    def __init__(self, host: str, port: int) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._to = (host, port)

    def send(self, payload: GnssFix | bytes, stamp_ns: int) -> None:
        with contextlib.suppress(OSError):
            self._socket.sendto(_said(payload, stamp_ns), self._to)

    def plug(self, is_in: bool) -> None:
        pass

    def close(self) -> None:
        self._socket.close()


class TcpNmeaSender:
    """A receiver with a TCP port: it listens, and sends its sentences to all clients."""

    def __init__(self, host: str, port: int) -> None:
        self._where = (host, port)
        self._lock = threading.Lock()
        self._clients: list[socket.socket] = []
        self._listener: socket.socket | None = None
        self.plug(True)

    def send(self, payload: GnssFix | bytes, stamp_ns: int) -> None:
        with self._lock:
            for client in tuple(self._clients):
                try:
                    client.sendall(_said(payload, stamp_ns))
                except OSError:
                    self._clients.remove(client)
                    client.close()

    def plug(self, is_in: bool) -> None:
        if is_in and self._listener is None:
            try:
                self._listener = socket.create_server(self._where)
            except OSError as error:
                raise BadInput(f"gnss on {self._where[0]}:{self._where[1]}: {error.strerror}") from None
            threading.Thread(target=self._accept, args=(self._listener,), daemon=True).start()
        elif not is_in and self._listener is not None:
            listener, self._listener = self._listener, None
            with contextlib.suppress(OSError):
                listener.shutdown(socket.SHUT_RDWR)
            listener.close()
            with self._lock:
                for client in self._clients:
                    client.close()
                self._clients = []

    def close(self) -> None:
        self.plug(False)

    def _accept(self, listener: socket.socket) -> None:
        while True:
            try:
                client, _ = listener.accept()
            except OSError:
                return
            client.settimeout(1.0)
            with self._lock:
                self._clients.append(client)


class CanSender:
    """Speed and yaw rate in the messages of the DBC file; other signals are zero, or their minimum."""

    def __init__(self, config: CanConfig) -> None:
        self._config, self._database = config, load_dbc(config.dbc)
        try:
            self._bus = can.Bus(channel=config.channel, interface=config.interface)
        except (can.CanError, ImportError, OSError, ValueError) as error:
            raise BadInput(f"CAN {config.channel}: {error}") from None

    def send(self, payload: EgoState | bytes, stamp_ns: int) -> None:
        for name, values in self._messages(payload).items():
            message = self._database.get_message_by_name(name)
            data = values if isinstance(values, bytes) else message.encode(values, scaling=True)
            frame = can.Message(arbitration_id=message.frame_id, data=data, is_extended_id=message.is_extended_frame)
            with contextlib.suppress(can.CanError):
                self._bus.send(frame)

    def plug(self, is_in: bool) -> None:
        pass

    def close(self) -> None:
        self._bus.shutdown()

    def _messages(self, payload: EgoState | bytes) -> dict[str, Any]:
        """The values to send, by the DBC's message names. Garbage is truncated, so that it cannot be decoded."""
        speed, yaw_rate = self._config.speed_mps, self._config.yaw_rate_radps
        if isinstance(payload, bytes):
            return {speed.message: payload[:1]}
        said: list[tuple[SignalConfig, float]] = [(speed, payload.speed_mps)]
        if yaw_rate is not None and payload.yaw_rate_radps is not None:
            said.insert(0, (yaw_rate, payload.yaw_rate_radps))
        found: dict[str, dict[str, float]] = {}
        for signal, value in said:
            message = self._database.get_message_by_name(signal.message)
            filled = {each.name: max(0.0, float(each.minimum or 0.0)) for each in message.signals}
            found.setdefault(signal.message, filled)[signal.signal] = value / signal.factor
        return found


def _gnss_sender(config: GnssConfig) -> Sender:
    if config.udp_port is not None:
        return UdpNmeaSender(_here(config.interface), config.udp_port)
    if config.tcp is not None:
        host, _, port = config.tcp.rpartition(":")
        return TcpNmeaSender(host, int(port))
    raise BadInput("gnss: replay cannot send to a serial line; set tcp or udp_port")


def _said(payload: GnssFix | bytes, stamp_ns: int) -> bytes:
    return payload if isinstance(payload, bytes) else sentences(payload, stamp_ns)


def _here(interface: str) -> str:
    return _LOOPBACK if interface == _EVERY else interface
