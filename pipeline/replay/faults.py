"""Injects sensor faults at chosen moments, to test programs that receive the data."""

from __future__ import annotations

import random
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError, model_validator

from pipeline.common.errors import BadInput
from pipeline.common.files.user_file_errors import first_complaint, read_yaml
from pipeline.replay.wire import WireEvent
from pipeline.sources.live.health import Sensor

FaultKind = Literal["silence", "garbage", "duplicate", "out_of_order", "clock_jump", "disconnect"]


class Fault(BaseModel):
    """One fault of one sensor. disconnect: nothing is sent; connections are closed and refused. clock_jump: the
    sensor's own clock is off by ``by_s``. garbage: random bytes are inserted. out_of_order, duplicate: affects every
    fifth message."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    sensor: Sensor
    """The affected stream."""
    kind: FaultKind
    """Type of fault; see the class."""
    from_s: float = Field(ge=0.0)
    """Seconds after the start."""
    to_s: float = Field(gt=0.0)
    """Seconds after the start at which the fault ends."""
    by_s: float = 7.0
    """clock_jump only: how far the clock jumps, seconds."""

    @model_validator(mode="after")
    def _check(self) -> Fault:
        if self.to_s <= self.from_s:
            raise ValueError("to_s must be after from_s")
        return self


def load(path: Path) -> tuple[Fault, ...]:
    """A YAML list of faults. BadInput names what is wrong."""
    try:
        return tuple(TypeAdapter(list[Fault]).validate_python(read_yaml(path, str(path))))
    except ValidationError as error:
        raise BadInput(f"{path}: {first_complaint(error, Fault)}") from None


def disturb(events: Iterable[WireEvent], faults: Sequence[Fault], start_ns: int, seed: int = 1) -> Iterator[WireEvent]:
    """The events that a car with these faults would send. The same seed gives the same garbage."""
    rng = random.Random(seed)
    held: dict[Sensor, WireEvent] = {}
    for count, event in enumerate(events):
        at_s = (event.send_ns - start_ns) / 1e9
        kinds = {fault.kind: fault for fault in faults if _is_on(fault, event.sensor, at_s)}
        if "silence" in kinds or "disconnect" in kinds:
            continue
        if "clock_jump" in kinds:
            event = event._replace(stamp_ns=event.stamp_ns + round(kinds["clock_jump"].by_s * 1e9))
        if "garbage" in kinds:
            yield event._replace(payload=rng.randbytes(rng.choice((1, 17, 1206, 1206, 1400))))
        if "out_of_order" in kinds and count % 5 == 0 and event.sensor not in held:
            held[event.sensor] = event
            continue
        yield event
        if "duplicate" in kinds and count % 5 == 0:
            yield event
        if event.sensor in held:
            yield held.pop(event.sensor)._replace(send_ns=event.send_ns)


def disconnected(faults: Iterable[Fault], sensor: Sensor, at_s: float) -> bool:
    """Whether the sensor is unplugged at this time."""
    return any(fault.kind == "disconnect" and _is_on(fault, sensor, at_s) for fault in faults)


def _is_on(fault: Fault, sensor: Sensor, at_s: float) -> bool:
    return fault.sensor == sensor and fault.from_s <= at_s < fault.to_s
