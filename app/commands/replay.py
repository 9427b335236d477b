"""`cipv replay`: send a recording as real sensor packets to any program that listens with the same live
configuration."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from itertools import chain, count
from pathlib import Path
from typing import Annotated

import tyro

from app.commands.support.arguments import option
from app.commands.support.options import SourceOptions
from pipeline.common.errors import BadInput
from pipeline.types.source import RawPackets


@dataclass(frozen=True)
class Replay:
    """Send a recording in real time as VLP-16 packets, MJPEG, NMEA and CAN to the addresses of a live config.

    Example: cipv replay sim:straight --config car.yaml
    """

    source: SourceOptions
    config: Annotated[Path, tyro.conf.arg(metavar="FILE")]
    """The live config (see `cipv live init`), whose ports and addresses are the targets"""
    speed: float = 1.0
    """Playback rate; the LiDAR keeps its rotation rate, so rates above 1 skip sweeps"""
    loop: bool = False
    """Start again at the end, until Ctrl-C"""
    faults: Annotated[Path | None, option("FILE")] = None
    """YAML list of faults to inject, e.g. [{sensor: camera, kind: disconnect, from_s: 5, to_s: 7}]"""

    def __call__(self) -> int:
        if not 0.05 <= self.speed <= 20.0:
            raise BadInput(f"--speed {self.speed:g}: between 0.05 and 20")
        from pipeline.replay.faults import load as load_faults  # sensor drivers, imported only if needed
        from pipeline.replay.messages import of_recording
        from pipeline.replay.replayer import replay
        from pipeline.replay.senders import open_senders
        from pipeline.sources.live.config import load

        config = load(str(self.config))
        faults = load_faults(self.faults) if self.faults is not None else ()
        source = self.source.open()
        if self.speed != 1.0 and isinstance(source, RawPackets):
            raise BadInput(
                f"--speed {self.speed:g}: the packets of a capture carry their own timestamps, so only 1 is possible"
            )
        senders = open_senders(config)
        mount = config.lidar.mount.T_ego_sensor() if config.lidar is not None else None
        rounds = count() if self.loop else range(1)
        span_ns = source.t_ns(len(source) - 1) - source.t_ns(0) + round(1e9 / source.rate_hz)
        messages = chain.from_iterable(
            (message._replace(t_ns=message.t_ns + number * span_ns) for message in of_recording(source))
            for number in rounds
        )
        try:
            sent = replay(messages, senders, speed=self.speed, T_ego_lidar=mount, faults=faults)
        except KeyboardInterrupt:
            return 0
        finally:
            for sender in senders.values():
                sender.close()
        said = ", ".join(f"{number} {sensor}" for sensor, number in sent.events.items())
        slow = f"; {sent.late} late, schedule delayed {sent.slips} times: this machine is too slow" if sent.late else ""
        print(f"cipv: sent {said or 'nothing'}{slow}", file=sys.stderr)
        return 0
