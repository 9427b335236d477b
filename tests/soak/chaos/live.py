"""Live sensors in a chaos soak: a replayed car with random faults, and a server that listens and records."""

from __future__ import annotations

import contextlib
import os
import random
import re
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
import yaml

from app.engine.engine import Engine
from app.engine.session_recording import SessionRecorder
from app.engine.snapshot import Snapshot
from pipeline.params import Params
from pipeline.recording import topics
from pipeline.recording.mcap.chain import verify
from pipeline.recording.session.messages import log_text
from pipeline.recording.session.source import SessionSource
from pipeline.replay.faults import Fault
from pipeline.sources import open_any
from pipeline.sources.live.config import load
from pipeline.sources.live.devices import udp
from pipeline.types.source import is_live_source
from tests.app.labels.server_process import set_clock
from tests.conftest import ROOT
from tests.soak.chaos.figures import JUMPS_S, Figures, resident_mb
from tests.soak.live.run import KINDS, config_file

_SENSORS = ("lidar", "camera", "gnss")
_DRIVE_S = 40.0
"""How long the car drives before it is restarted, as after a flat battery."""
_FAULTS = 8
_BACK_WITHIN_S = 40.0
"""Maximum driving time until all sensors are back. The time that a killed car takes to render its images again does not
count: it depends on the machine's load, and no sensor sends meanwhile."""
_DRIVES_AGAIN_WITHIN_S = 600.0
_FLOOD = 3000
_SEVERAL_S = 3.0


class LiveCar:
    """A car whose sensors fail one after another and which is switched off, and a recorder that runs all the time."""

    def __init__(self, folder: Path, chance: random.Random, figures: Figures) -> None:
        folder.mkdir()
        self._folder, self._chance, self._figures = folder, chance, figures
        self._config = config_file(folder)
        self._car: subprocess.Popen[bytes] | None = None
        self._driven_s = 0.0
        self._drives_since_s: float | None = None
        self._seen_s = dict.fromkeys(_SENSORS, 0.0)
        self._ticks = 0
        self._ahead_s = 0.0
        self._desk = SessionRecorder(folder)
        self._engine = Engine(open_any, None, Params(), uri=f"live:{self._config}", playing=True, recorder=self._desk)
        self._engine.listen(self._shown)

    def drive(self, stop: threading.Event) -> None:
        """Run one car after another until ``stop``, each with its own faults."""
        faults = self._folder / "faults.yaml"
        while not stop.is_set():
            faults.write_text(yaml.safe_dump([each.model_dump() for each in self._random_faults()]))
            command = [sys.executable, "-m", "tests.soak.live.car", self._config, str(_DRIVE_S), faults]
            with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as self._car:
                begins = threading.Thread(target=self._hear_it_begin, args=(self._car,))
                begins.start()
                while self._car.poll() is None and not stop.wait(0.2):
                    pass
                self._car.kill()
                begins.join()
            self._driven_s, self._drives_since_s = self._driven(), None

    def _hear_it_begin(self, car: subprocess.Popen[bytes]) -> None:
        assert car.stdout is not None
        if car.stdout.readline():
            self._drives_since_s = time.monotonic()

    def _driven(self) -> float:
        """Total time in seconds in which a car was sending."""
        since_s = self._drives_since_s
        return self._driven_s + (time.monotonic() - since_s if since_s is not None else 0.0)

    def begin(self) -> None:
        """Start recording, from the first tick on."""
        self._engine.start()
        self._engine.wait_for(lambda shown: shown.processed is not None, _DRIVES_AGAIN_WITHIN_S)
        self._desk.start(self._engine.source)

    # ------------------------------------------------------------ faults

    def lend_clock(self, patch: pytest.MonkeyPatch) -> None:
        """Let ``set_clock`` decide what this process sees of the system's clock, with the times of datagrams."""
        set_clock(patch, lambda: self._ahead_s)
        received_at = udp._received_at
        patch.setattr(udp, "_received_at", lambda said: received_at(said) + round(self._ahead_s * 1e9))

    def set_clock(self) -> None:
        """Set the clock of the computer that records."""
        self._ahead_s = self._chance.choice(JUMPS_S)

    def switch_off(self) -> None:
        """Switch off all sensors at once, in the middle of a packet; they return half a minute later."""
        if self._car is not None:
            self._car.kill()

    def flood(self) -> None:
        """Let another sender flood the ports of the LiDAR and the GNSS receiver."""
        config = load(str(self._config))
        assert config.lidar is not None
        assert config.gnss is not None
        ports = (config.lidar.data_port, config.lidar.position_port, config.gnss.udp_port)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
            stranger.bind(("127.0.0.2", 0))
            for _ in range(_FLOOD):
                with contextlib.suppress(OSError):
                    data = self._chance.choice((b"\xff\xee" * 603, b"$GPRMC,", self._chance.randbytes(512)))
                    stranger.sendto(data, ("127.0.0.1", self._chance.choice(ports) or 9))

    # ------------------------------------------------------------ checks

    def check(self) -> None:
        """Check that every sensor is back in time after its faults, and that the recording continues."""
        asked_s, driven_s = time.monotonic(), self._driven()
        while missing := [name for name, at_s in self._seen_s.items() if at_s < asked_s]:
            is_late = self._driven() - driven_s > _BACK_WITHIN_S
            if is_late or time.monotonic() - asked_s > _DRIVES_AGAIN_WITHIN_S:
                self._figures.wrong += [f"the {name} did not come back: {self._health_of(name)}" for name in missing]
                break
            time.sleep(0.1)
        self._figures.live_resident_mb.append(resident_mb(os.getpid()))
        self._figures.slowest_return_s = round(max(self._figures.slowest_return_s, self._driven() - driven_s), 1)
        state = self._desk.state
        if not self._engine.alive or state is None or state.error is not None:
            self._figures.wrong.append(f"the live recording ended: {state.error if state is not None else 'stopped'}")

    def _health_of(self, name: str) -> str:
        source = self._engine.source
        if source is None or not is_live_source(source):
            return "no sensors are open"
        return str([each for each in source.health() if each.sensor == name])

    def end(self) -> None:
        """Close the recording and read it back: missing data must be reported, and nothing may be changed."""
        state = self._desk.stop()
        self._engine.stop()
        if state is None:
            self._figures.wrong.append("there is no live recording")
            return
        read, said = 0, 0
        for file in state.files:
            if verify(Path(file)).state != "intact":
                self._figures.wrong.append(f"{file}: {verify(Path(file))}")
            session = SessionSource("a", str(file))
            read += len(session)
            notes = (log_text(topics.NOTES, each.data) for each in session.file.messages((topics.NOTES,)))
            said += sum(int(found[1]) for text in notes if (found := re.search(r"(\d+) frames", text)))
            session.close()
        if read != state.frames or state.dropped > said:
            self._figures.wrong.append(
                f"live: {state.frames} frames, {read} read, {state.dropped} dropped, {said} said"
            )
        self._figures.live_ticks, self._figures.live_frames = self._ticks, read

    def _shown(self, snapshot: Snapshot) -> None:
        tick, now_s = snapshot.processed, time.monotonic()
        if tick is None:
            return
        self._ticks += 1
        frame = tick.frame
        for name, there in zip(_SENSORS, (frame.sweep, frame.image, frame.gnss), strict=True):
            if there is not None:
                self._seen_s[name] = now_s
        wrong = [f"live: {each.text}" for each in snapshot.notices if each.level == "error"]
        self._figures.wrong += [text for text in wrong if text not in self._figures.wrong]

    def _random_faults(self) -> list[Fault]:
        found = []
        for _ in range(_FAULTS):
            sensor, kind = self._chance.choice(KINDS)
            from_s = round(self._chance.uniform(2.0, _DRIVE_S - 2.0 * _SEVERAL_S), 2)
            to_s = from_s + round(self._chance.uniform(0.5, _SEVERAL_S), 2)
            found.append(Fault.model_validate({"sensor": sensor, "kind": kind, "from_s": from_s, "to_s": to_s}))
            self._figures.befell[f"{sensor}: {kind}"] += 1
        return found
