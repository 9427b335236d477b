"""Experiment: the car-to-car rear grid of Euro NCAP, and UN Regulation 152 beside it.

CCRs: 10–80 km/h towards a standing car. CCRm: 30–80 km/h towards one that drives 20 km/h. Both in steps of 5 km/h, at
five overlaps. CCRb: both at 50 km/h, 12 or 40 m apart, the lead brakes at 2 or 6 m/s². Impact speeds are relative, in
the colours of Euro NCAP's protocol of 2026 (Crash Avoidance, Frontal Collisions, section 5.2, as the rating calculator
that Euro NCAP publishes, euroncap-rating-2026 5.4.9, has them). As in a test, a robot holds the speed until AEB acts; a
run whose approach left the protocol's tolerance is void.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

from pipeline.evaluation.experiments.network import embedded
from pipeline.evaluation.experiments.sections import (
    GIVEN,
    Boxes,
    Cell,
    Coloured,
    Experiment,
    Replay,
    Scene,
    Section,
    Table,
    Tone,
)
from pipeline.evaluation.experiments.track import Drive, approach, drive_charts, parameters, scene
from pipeline.params import Params
from pipeline.run import Sensors
from pipeline.simulation.loop import NetworkEyes, Setup, TruthEyes
from pipeline.simulation.replay import as_driven
from pipeline.simulation.scenario import Scenario

KMH = 1.0 / 3.6
Test = Literal["CCRs", "CCRm", "CCRb"]
OVERLAPS = (-50, -75, 100, 75, 50)
"""Share of the ego car's width that meets the target, %. Negative: the target stands to the ego car's left."""
EGO_WIDTH_M = 1.82
MOVING_KMH = 20.0
BRAKED_KMH = 50.0
START_TTC_S = 4.0
_RUN_UP_S = 1.5
SPEED_TOLERANCE_MPS = 1.0 * KMH
BANDS: tuple[tuple[float, tuple[tuple[float, Tone], ...]], ...] = (
    (50.0, ((10.0, "yellow"), (20.0, "orange"), (30.0, "brown"))),
    (40.0, ((10.0, "orange"), (20.0, "brown"))),
    (30.0, ((10.0, "brown"),)),
    (0.0, ()),
)
"""From which speed of the ego car, km/h, which relative impact speeds, km/h, have a colour: each those below. Green is
an impact avoided, red all others. The protocol tests every 10 km/h; in between, the bands of the speed below hold."""
R152_LIMITS: tuple[tuple[float, float], ...] = ((42.0, 0.0), (45.0, 15.0), (50.0, 25.0), (55.0, 30.0), (60.0, 35.0))
"""UN R152, 5.2.1.4, category M1 unladen: up to this relative speed, km/h, the impact may be no faster than that."""
Kind = tuple[Sensors, str, Boxes]
SETUPS: tuple[Kind, ...] = (
    ("both", "AEB", "truth"),
    ("lidar", "AEB", "truth"),
    ("both", "ACC", "truth"),
    ("lidar", "ACC", "truth"),
    ("both", "ACC + AEB", "truth"),
)
NETWORK: Kind = ("both", "AEB", "network")
NETWORK_SAMPLE: tuple[tuple[Test, float, int], ...] = (
    *(("CCRs", speed, 100) for speed in (20.0, 40.0, 60.0, 80.0)),
    *(("CCRs", 40.0, overlap) for overlap in (-50, 50)),
    *(("CCRm", speed, 100) for speed in (40.0, 60.0, 80.0)),
)
"""What is driven with the embedded network on drawn pictures too, beside the lead that brakes at 6 m/s² 40 m ahead."""
_NAMES = {"both": "fused", "lidar": "LiDAR", "camera": "camera"}


@dataclass(frozen=True)
class Case:
    """speed_kmh: of the ego car. overlap: %. gap_m, decel_mps2: CCRb only. boxes: whose the camera's
    are."""

    test: Test
    speed_kmh: float
    overlap: int
    sensors: Sensors
    controller: str
    gap_m: float = 0.0
    decel_mps2: float = 0.0
    boxes: Boxes = "truth"

    @property
    def kind(self) -> Kind:
        return self.sensors, self.controller, self.boxes

    @property
    def name(self) -> str:
        """Fit for a file."""
        what = f"gap{self.gap_m:.0f}_brake{self.decel_mps2:.0f}" if self.test == "CCRb" else f"overlap{self.overlap}"
        kind = "_".join((_NAMES[self.sensors], self.controller.replace(" + ", "+"), self.boxes))
        return f"{self.test}_{self.speed_kmh:.0f}kmh_{what}_{kind}".lower()

    def closing_mps(self) -> float:
        return (self.speed_kmh - (MOVING_KMH if self.test == "CCRm" else 0.0)) * KMH


@dataclass(frozen=True)
class Result:
    """impact_kmh: relative, 0 when avoided. void: why the run does not count, empty when it does."""

    impact_kmh: float
    void: str
    drive: Drive | None = field(default=None, compare=False)


def cases(short: bool) -> list[Case]:
    speeds = {"CCRs": range(10, 81, 5), "CCRm": range(30, 81, 5)} if not short else {"CCRs": (30, 60), "CCRm": (50,)}
    overlaps = (-50, 100) if short else OVERLAPS
    found = []
    for sensors, controller, _ in SETUPS[:2] if short else SETUPS:
        grid: list[tuple[Test, float, int]] = [
            (test, float(speed), overlap) for test in ("CCRs", "CCRm") for speed in speeds[test] for overlap in overlaps
        ]
        found += [Case(test, speed, overlap, sensors, controller) for test, speed, overlap in grid]
        found += [
            Case("CCRb", BRAKED_KMH, 100, sensors, controller, gap, decel)
            for decel in (2.0, 6.0)
            for gap in (12.0, 40.0)
            if not short or (decel, gap) == (6.0, 40.0)
        ]
    if short:
        return found
    sensors, controller, boxes = NETWORK
    sample = [Case(*each, sensors, controller, boxes=boxes) for each in NETWORK_SAMPLE]
    return [*found, *sample, Case("CCRb", BRAKED_KMH, 100, sensors, controller, 40.0, 6.0, boxes)]


def run(case: Case) -> Result:
    """One approach, driven."""
    eyes = TruthEyes() if case.boxes == "truth" else NetworkEyes(embedded())
    drive = approach(_scenario(case), Setup(_params(case), case.sensors, eyes))
    return Result((drive.impact_mps or 0.0) / KMH, _void(case, drive), drive)


def _params(case: Case) -> Params:
    return parameters(case.controller, case.speed_kmh * KMH)


def _scenario(case: Case) -> Scenario:
    speed = case.speed_kmh * KMH
    aside = (1.0 - abs(case.overlap) / 100.0) * EGO_WIDTH_M * (1.0 if case.overlap < 0 else -1.0)
    target: dict[str, object] = {"offset_m": aside, "colour": "#8e9aa3"}
    if case.test == "CCRb":
        target |= {
            "ahead_m": case.gap_m,
            "speed_mps": {0.0: speed},
            "brake": {"at_s": _RUN_UP_S, "decel_mps2": case.decel_mps2},
        }
    else:
        target |= {
            "ahead_m": case.closing_mps() * (START_TTC_S + _RUN_UP_S),
            "speed_mps": {0.0: MOVING_KMH * KMH if case.test == "CCRm" else 0.0},
        }
    return scene({0.0: speed}, target, _RUN_UP_S + 14.0, seed=0)


def replay(case: Case, result: Result) -> Replay:
    """The drive of one cell."""
    assert result.drive is not None
    ended = f"Impact at {result.impact_kmh:.0f} km/h." if result.impact_kmh else "The impact was avoided."
    title = f"{case.test}, {_at(case)}: {_label(case.kind)}"
    return Replay(
        case.name,
        title,
        (f"Void: {result.void}." if result.void else ended,),
        as_driven(_scenario(case), result.drive.motions, title),
        _params(case),
        case.sensors,
        drive_charts(result.drive),
        GIVEN if case.boxes == "truth" else None,
    )


def _at(case: Case) -> str:
    at = f"{case.gap_m:.0f} m, −{case.decel_mps2:.0f} m/s²" if case.test == "CCRb" else f"overlap {case.overlap} %"
    return f"{case.speed_kmh:.0f} km/h, {at}"


def _label(kind: Kind) -> str:
    sensors, controller, boxes = kind
    return f"{_NAMES[sensors]}, {controller}" + (", network" if boxes == "network" else "")


def _void(case: Case, drive: Drive) -> str:
    """Why the approach was not as the protocol wants it: speed within 0 to +1 km/h from the test's start until the car
    brakes by itself, which it may not do before the start."""
    wanted = case.speed_kmh * KMH
    for t_s, speed, state, accel in zip(drive.t_s, drive.speed_mps, drive.states, drive.accel_mps2, strict=True):
        acts = accel < -0.5 or state in ("partial_brake", "full_brake")
        if t_s < _RUN_UP_S and acts:
            return "braked before the start"
        if acts:
            return ""
        if t_s >= _RUN_UP_S and not -0.01 <= speed - wanted <= SPEED_TOLERANCE_MPS:
            return f"speed off by {(speed - wanted) / KMH:.1f} km/h"
    return ""


def tone(speed_kmh: float, result: Result) -> Tone:
    """A cell's colour at this speed of the ego car."""
    if result.void:
        return "grey"
    if result.impact_kmh <= 0.0:
        return "green"
    bands = next(bands for from_kmh, bands in BANDS if speed_kmh >= from_kmh)
    return next((colour for limit, colour in bands if result.impact_kmh < limit), "red")


def report(cases: Sequence[Case], results: Sequence[Result]) -> Section:
    done = dict(zip(cases, results, strict=True))
    kinds = list(dict.fromkeys(case.kind for case in cases))
    tables = [_summary(kinds, done), _r152(done)]
    for kind in kinds:
        mine = {case: result for case, result in done.items() if case.kind == kind}
        tables += [_grid(test, _label(kind), mine) for test in ("CCRs", "CCRm")]
        tables.append(_braked(_label(kind), mine))
    return Section(
        "ncap",
        "Euro NCAP car-to-car rear grid",
        (
            f"Every run starts {_RUN_UP_S:g} s before TTC {START_TTC_S:g} s with the speed held; the camera's boxes "
            "are projected truth with a detector's errors, and in a sample of the cells (network) the embedded "
            "network's on drawn pictures. AEB: a robot holds the speed and only AEB brakes. ACC: the "
            "paper's speed law alone, set to the test speed. Cells are relative impact speeds in km/h; 0 is avoided. "
            "Colours are those of Euro NCAP's protocol of 2026, whose bands depend on the test speed: green avoided, "
            "then yellow, orange, brown, red. Grey: the approach was not as the protocol wants it.",
            _verdict(done),
        ),
        tuple(tables),
        scenes=tuple(
            Scene(f"{case.test}, {_at(case)}", _scenario(case), _RUN_UP_S + 2.0)
            for case in {case.test: case for case in done}.values()
        ),
    )


def _summary(kinds: list[Kind], done: dict[Case, Result]) -> Table:
    rows: list[tuple[Cell, ...]] = []
    for kind in kinds:
        for test in ("CCRs", "CCRm", "CCRb"):
            valid = [
                result for case, result in done.items() if (case.kind, case.test) == (kind, test) and not result.void
            ]
            avoided = sum(result.impact_kmh == 0.0 for result in valid)
            mean = sum(result.impact_kmh for result in valid) / len(valid) if valid else None
            worst = max((result.impact_kmh for result in valid), default=None)
            rows.append((_NAMES[kind[0]], kind[1], kind[2], test, len(valid), avoided, mean, worst))
    columns = ("sensors", "controller", "boxes", "test", "valid runs", "avoided", "mean impact km/h", "worst km/h")
    return Table("What each gives", columns, tuple(rows), decimals=1)


def _grid(test: Test, name: str, done: dict[Case, Result]) -> Table:
    mine = {(case.speed_kmh, case.overlap): (case, result) for case, result in done.items() if case.test == test}
    overlaps = [overlap for overlap in OVERLAPS if any(key[1] == overlap for key in mine)]
    rows = tuple(
        (f"{speed:.0f} km/h", *(_cell(mine.get((speed, overlap))) for overlap in overlaps))
        for speed in sorted({speed for speed, _ in mine})
    )
    return Table(f"{test}: {name}", ("speed", *(f"{overlap} %" for overlap in overlaps)), rows, decimals=0)


def _braked(name: str, done: dict[Case, Result]) -> Table:
    mine = {(case.decel_mps2, case.gap_m): (case, result) for case, result in done.items() if case.test == "CCRb"}
    gaps = sorted({gap for _, gap in mine})
    rows = tuple(
        (f"−{decel:.0f} m/s²", *(_cell(mine.get((decel, gap))) for gap in gaps))
        for decel in sorted({decel for decel, _ in mine})
    )
    return Table(f"CCRb at 50 km/h: {name}", ("lead brakes", *(f"{gap:.0f} m" for gap in gaps)), rows, decimals=0)


def _cell(found: tuple[Case, Result] | None) -> Cell | Coloured:
    if found is None:
        return None
    case, result = found
    return Coloured(result.void or result.impact_kmh, tone(case.speed_kmh, result), case.name)


def _r152(done: dict[Case, Result]) -> Table:
    """Standing and moving targets, full overlap, AEB alone, against the Regulation's limits."""
    rows: list[tuple[Cell | Coloured, ...]] = []
    for test in ("CCRs", "CCRm"):
        for closing in sorted({round(case.closing_mps() / KMH) for case in done if case.test == test}):
            limit = r152_limit_kmh(closing)
            if limit is None:
                continue
            cells = [
                _passes(case, result, limit)
                for sensors in ("both", "lidar")
                for case, result in done.items()
                if (case.test, case.kind, case.overlap) == (test, (sensors, "AEB", "truth"), 100)
                and round(case.closing_mps() / KMH) == closing
            ]
            rows.append((test, f"{closing} km/h", limit, *cells))
    columns = ("test", "relative speed", "limit km/h", "fused km/h", "LiDAR km/h")
    caption = "UN R152, M1 unladen: green within the limit, red beyond it."
    return Table("UN R152: largest relative impact speed", columns, tuple(rows), caption, 0)


def r152_limit_kmh(relative_kmh: float) -> float | None:
    """The impact speed that the Regulation permits; null beyond the speeds that it covers."""
    return next((limit for up_to, limit in R152_LIMITS if relative_kmh <= up_to), None)


def _passes(case: Case, result: Result, limit_kmh: float) -> Coloured:
    return Coloured(result.impact_kmh, "green" if result.impact_kmh <= limit_kmh else "red", case.name)


def _verdict(done: dict[Case, Result]) -> str:
    """AEB alone: how many cells fused ends slower than the LiDAR alone, and how many faster."""
    pairs = [
        (result, done[other])
        for case, result in done.items()
        if case.kind == ("both", "AEB", "truth")
        and (other := Case(case.test, case.speed_kmh, case.overlap, "lidar", "AEB", case.gap_m, case.decel_mps2))
        in done
    ]
    counted = [(fused.impact_kmh, lidar.impact_kmh) for fused, lidar in pairs if not fused.void and not lidar.void]
    better = sum(fused < lidar - 1.0 for fused, lidar in counted)
    worse = sum(fused > lidar + 1.0 for fused, lidar in counted)
    return (
        f"With AEB alone, of {len(counted)} runs fused ends slower than the LiDAR alone in {better}, faster in {worse} "
        f"and the same (within 1 km/h) in {len(counted) - better - worse}."
    )


NCAP = Experiment("ncap", "euroncap", "Euro NCAP car-to-car rear grid", cases, run, report, replay)
