"""`cipv live init` and `cipv live check`: write the sensor configuration of a car, and test each sensor."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro
from rich.console import Console
from rich.table import Table

from pipeline.common.errors import BadInput
from pipeline.common.files.output_files import write_new

if TYPE_CHECKING:
    from pipeline.sources.live.check import SensorReport

_LONGEST_S = 3600.0


@dataclass(frozen=True)
class Live:
    """Set up live sensors: `init` writes a commented file, `check` tests each sensor in it.

    Example: cipv live init car.yaml && cipv live check car.yaml
    """

    what: tyro.conf.Positional[Literal["init", "check"]]
    """init: write the file; check: listen to each sensor and report its health"""
    file: tyro.conf.Positional[Path] = Path("live.yaml")
    """The configuration file; `init` never overwrites one"""
    seconds: Annotated[float, tyro.conf.arg(metavar="S")] = 3.0
    """check: how long to listen"""
    json: bool = False
    """check: print the figures as JSON"""

    def __call__(self) -> int:
        return self._init() if self.what == "init" else self._check()

    def _init(self) -> int:
        from pipeline.sources.live.config_template import TEMPLATE

        write_new(self.file, TEMPLATE)
        print(f"{self.file} written: edit it, then `cipv live check {self.file}`")
        return 0

    def _check(self) -> int:
        """Returns 0 if every sensor delivers data, else 1."""
        if not 0.0 < self.seconds <= _LONGEST_S:
            raise BadInput(f"--seconds {self.seconds:g}: between 0 and {_LONGEST_S:g}")
        from pipeline.sources.live.check import check  # sensor drivers, imported only if needed
        from pipeline.sources.live.config import load
        from pipeline.sources.live.source import LiveSensors

        source = LiveSensors(f"live:{self.file}", load(str(self.file)))
        reports = check(source, self.seconds)
        if self.json:
            print(json.dumps({report.health.sensor: _plain(report) for report in reports}, indent=1))
        else:
            _show(reports)
        return 0 if all(report.is_good for report in reports) else 1


def _plain(report: SensorReport) -> dict[str, Any]:
    """A flat object for one sensor, with milliseconds and hertz to three decimals."""
    values = {**asdict(report.health), **asdict(report)}
    del values["health"], values["sensor"]
    return {name: round(value, 3) if isinstance(value, float) else value for name, value in values.items()}


def _show(reports: list[SensorReport]) -> None:
    table = Table("sensor", "state", "rate", "jitter", "age", "lost", "refused", "clock offset", "about")
    for report in reports:
        health = report.health
        about = [health.note, report.cost or ""]
        if report.pps is not None:
            about.append(f"PPS {report.pps}")
        if report.skew_ms is not None:
            about.append(f"{report.skew_ms:+.1f} ms from the sweep")
        table.add_row(
            health.sensor,
            health.state,
            _with_unit(health.rate_hz, "Hz"),
            _with_unit(health.jitter_ms, "ms"),
            _with_unit(health.age_ms, "ms"),
            str(health.lost),
            str(report.refused),
            _with_unit(report.clock_offset_ms, "ms"),
            "; ".join(text for text in about if text),
        )
    Console(width=None if Console().is_terminal else 160).print(table)


def _with_unit(value: float | None, unit: str) -> str:
    return "–" if value is None else f"{value:.1f} {unit}"
