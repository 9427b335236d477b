"""Ego speed and yaw rate from the car's CAN bus, decoded with a DBC file."""

from __future__ import annotations

import contextlib
import math
import re
from pathlib import Path
from typing import Any

import can
import cantools

from pipeline.common.files.user_files import LARGEST_TEXT_BYTES, read_regular
from pipeline.sources.live.clock import HostClock
from pipeline.sources.live.config import CanConfig, SignalConfig
from pipeline.sources.live.devices.device_reader import POLL_S, DeviceLost, Reader, ReaderStop
from pipeline.sources.live.devices.sensor_input import Deliver
from pipeline.sources.live.health import StreamStats
from pipeline.types import EgoState
from pipeline.types.source import SourceError

_WORST_S = 2.5
"""Opening a serial adapter takes python-can 2 s, and reading polls twice."""
_YAW_RATE_KEPT_NS = 500_000_000
_LIMITS = (
    (re.compile(r"^\s*BO_\s+\d+\s+\w+\s*:\s*(\d+)", re.MULTILINE), 64),
    (re.compile(r"^\s*SG_[^:\n]*:\s*(\d+)\s*\|", re.MULTILINE), 511),
    (re.compile(r"^\s*SG_[^:\n]*:\s*\d+\s*\|\s*(\d+)\s*@", re.MULTILINE), 512),
)
"""Limits of a message's bytes, a signal's first bit and its length: cantools allocates every bit up to there. CAN FD
has 64 bytes; a J1939 message in packets has more, and is not supported."""
_FASTEST_MPS, _FASTEST_RADPS = 120.0, 5.0


class CanInput:
    """Delivers an ``EgoState`` for every message that contains the speed, with the last known yaw rate. SourceError if
    the DBC file does not define the signals."""

    def __init__(self, config: CanConfig, time_offset_ms: float, clock: HostClock, deliver: Deliver[EgoState]) -> None:
        self.stats = StreamStats("ego")
        self._config, self._clock, self._deliver = config, clock, deliver
        self._offset_ns = round(time_offset_ms * 1e6)
        self._messages = _messages(config)
        self._yaw_rate: tuple[int, float] | None = None
        self.readers: tuple[Reader, ...] = (Reader("can", self._read, self._say, _WORST_S),)

    def clock_offset_ms(self) -> float | None:
        return None

    def _read(self, stop: ReaderStop) -> None:
        config = self._config
        options: dict[str, Any] = {"bitrate": config.bitrate} if config.bitrate is not None else {}
        try:
            with can.Bus(channel=config.channel, interface=config.interface, **options) as bus:
                while not stop:
                    message = bus.recv(POLL_S)
                    if message is not None:
                        self.receive(message)
        except (can.CanError, ImportError, OSError, ValueError) as error:
            raise DeviceLost(f"CAN {config.channel}: {str(error).splitlines()[0] if str(error) else error!r}") from None

    def receive(self, message: can.Message) -> None:
        """Process a CAN frame; frames with other arbitration ids are ignored."""
        known = self._messages.get(message.arbitration_id)
        if known is None or message.is_error_frame or message.is_remote_frame:
            return
        now_ns = self._clock.now_ns()
        try:
            values = known.decode(bytes(message.data), decode_choices=False)
        except Exception:  # cantools' codec raises various errors for a message that is truncated or not of this DBC
            self.stats.lost += 1
            return
        self._take(known.name, values, self._clock.of_wall_ns(round(message.timestamp * 1e9)), now_ns)

    def _take(self, name: str, values: dict[str, Any], t_ns: int, now_ns: int) -> None:
        yaw_rate = _value(self._config.yaw_rate_radps, name, values, _FASTEST_RADPS)
        if yaw_rate is not None:
            self._yaw_rate = (t_ns, yaw_rate)
        speed_mps = _value(self._config.speed_mps, name, values, _FASTEST_MPS)
        if speed_mps is None:
            return
        is_fresh = self._yaw_rate is not None and t_ns - self._yaw_rate[0] <= _YAW_RATE_KEPT_NS
        t_ns += self._offset_ns
        self.stats.note = ""
        self.stats.arrived(now_ns, t_ns)
        self._deliver(
            t_ns, EgoState(t_ns, speed_mps, self._yaw_rate[1] if is_fresh and self._yaw_rate else None), now_ns
        )

    def _say(self, text: str) -> None:
        self.stats.note = text


def load_dbc(path: Path) -> Any:
    """cantools' database. SourceError if the file is not valid."""
    try:
        text = read_regular(path, LARGEST_TEXT_BYTES).decode("cp1252", "replace")
    except OSError as error:
        raise SourceError(f"{path}: {error.strerror}") from None
    if any(int(number) > limit for pattern, limit in _LIMITS for number in pattern.findall(text)):
        raise SourceError(f"{path}: not a DBC file: a message or a signal beyond the 64 bytes of CAN FD")
    try:
        return cantools.database.load_string(text, "dbc")
    except Exception as error:  # each of cantools' parsers has its own error class, whose text quotes the file
        line = re.search(r"\bline (\d+)", str(error))
        where = f" in line {line[1]}" if line else ""
        raise SourceError(f"{path}: not a DBC file{where}") from None


def _messages(config: CanConfig) -> dict[int, Any]:
    """The required messages of the DBC, by arbitration id."""
    database, found = load_dbc(config.dbc), {}
    for wanted in (config.speed_mps, config.yaw_rate_radps):
        if wanted is None:
            continue
        message = None
        with contextlib.suppress(KeyError):
            message = database.get_message_by_name(wanted.message)
        if message is None or wanted.signal not in {signal.name for signal in message.signals}:
            raise SourceError(f"{config.dbc}: no signal {wanted.signal} in a message {wanted.message}")
        found[message.frame_id] = message
    return found


def _value(wanted: SignalConfig | None, name: str, values: dict[str, Any], largest: float) -> float | None:
    """The signal in SI units, if this message contains it and its value is possible."""
    if wanted is None or wanted.message != name or wanted.signal not in values:
        return None
    value = float(values[wanted.signal]) * wanted.factor
    return value if math.isfinite(value) and abs(value) <= largest else None
