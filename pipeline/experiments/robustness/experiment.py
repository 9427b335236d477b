"""Experiment: how often the pipeline fails in random traffic, per thousand kilometres.

Each case is an independent kilometre (``traffic``). Boxes are ground truth with the errors measured on a real detector,
the LiDAR is ray-cast, and no image is rendered. The rates have exact Poisson bounds, so a short run shows how uncertain
it is.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from pipeline.evaluation.report_sections import AnyCell, Driven, ReportSection, Table
from pipeline.experiments.experiment import Experiment, ExperimentDrive
from pipeline.experiments.robustness import road_kinds, traffic
from pipeline.experiments.robustness.judge import KINDS, Failure, Judge, Kind
from pipeline.params import Params, with_changes
from pipeline.simulation.unseen import frames
from pipeline.step import State, step
from pipeline.warm_up import warm_up

AS_IS = "unchanged"
VARIANTS: Mapping[str, Mapping[str, Any]] = {
    AS_IS: {},
    "no existence estimate": {"existence.enabled": False},
    "missing boxes ignored": {"existence.use_missing_boxes": False},
    "braking at any existence": {"existence.min_braking": 0.0},
    "braking on first camera range": {"existence.camera_ranges": 1},
    "no minimum lead probability": {
        "cipv.become_existence": 0.0,
        "cipv.become_probability": 0.0,
        "cipv.become_camera": 0.0,
        "cipv.become_standing": 0.0,
        "cipv.become_oncoming": 0.0,
        "cipv.stay_probability": 0.0,
        "cipv.stay_standing": 0.0,
    },
    "driven leads kept like others": {"cipv.stay_driving": 0.4},
    "parked leads kept like others": {"cipv.stay_standing": 0.0},
    "camera at the edge trusted": {"cipv.become_camera": 0.0},
    "gaps without error": {"acc.gap_sigmas": 0.0},
    "standing vehicles treated as moving": {"cipv.become_standing": 0.0},
    "oncoming vehicles treated like others": {"cipv.become_oncoming": 0.0},
    "crossing vehicles treated like others": {"cipv.use_crossing": False},
    "wide clusters not split": {"cluster.divide_m": 3.0},
    "clusters of two tracks not split": {"cluster.divide_tracked": False},
    "clusters nearer than their track not split": {"cluster.divide_nearer": False},
    "wide clusters taken for vehicles": {"cipv.max_short_side_m": 40.0},
    "growing footprints move sideways": {"lidar_tracking.rigid_sideways": False},
    "what is cut off moves the rest": {"lidar_tracking.cut_off_is_no_motion": False},
    "ACC acts on one frame": {"acc.confirm_frames": 1},
    "ACC acts on an unknown speed at once": {"acc.speed_hits": 1},
    "no confirmation": {"cipv.confirm_hits": 1},
    "unconfirmed leads kept unseen": {"cipv.confirm_lead": False},
    "carried objects may become the lead": {"cipv.carried_may_become_lead": True},
    "kept where sensors contradict each other": {
        "cipv.forget_at_takeover": False,
        "existence.forget_at_takeover": False,
    },
    "in path decided per frame": {"cipv.decide_s": 0.0},
    "motion kept relative to the car": {"motion.keep_over_ground": False},
    "no innovation gate": {"vision_tracking.max_nis": 1000.0},
    "wide camera gate": {"vision_tracking.gate_sigmas": 10.0},
    "no road edges": {"path.use_edges": False},
    "no corners": {"path.use_corners": False},
    "path errors of one normal distribution": {"cipv.road_goes_on": 0.0},
    "flanks taken for rears": {"cipv.use_flank": False},
    "boxes widen what drives along": {"cipv.narrow_along": False},
    "cut-ins not proved": {"cipv.prove_cut_in": False},
    "heights of other vehicles kept": {"vision_tracking.forget_heights": False},
    "tall boxes treated like others": {"vision_tracking.use_aspect": False},
    "boxes placed by height alone": {"fusion.use_ground_contact": False},
    "merged clusters left whole": {"fusion.merged_clusters": False},
    "no single returns": {"fusion.single_returns": False},
    "returns over the roof range": {"fusion.roof_share": 0.0},
    "no range gate": {"fusion.range_gate": False},
    "no size gate": {"fusion.size_gate": False},
    "boxes change clusters freely": {"fusion.keep_partners": False},
    "first clusters contradict the camera": {"fusion.settled_boxes": False},
    "AEB acts on one frame": {"aeb.confirm_frames": 1},
    "braking for what was in the path": {"aeb.react_to_present": False},
    "braking for what crosses over": {"aeb.react_where_met": False},
    "braking for what has entered only": {"aeb.react_to_crossing": False},
    "camera speeds without error": {"aeb.closing_sigmas": 0.0},
}
"""The parameter that switches off each rule against false leads."""
ALLOWED: Mapping[Kind, float] = {
    "phantom full braking": 0.0,
    "phantom partial braking": 1.0,
    "lead missed": 2.0,
    "lead late": 2.0,
}
"""Permitted failures per 1,000 km. A requirement fails if the lower bound exceeds this, since a short run cannot
distinguish a few failures from none."""
_SHORT_KM = 2
_CONFIDENCE = 0.95
_WORST = 40


@dataclass(frozen=True)
class Kilometre:
    """One case: a kilometre of random traffic."""

    seed: int
    """Seed of the suite."""
    number: int
    """Number of the kilometre; together with the seed, it determines road and traffic."""
    variants: tuple[str, ...] = (AS_IS,)
    """Names of the variants that run on the same frames."""


@dataclass(frozen=True)
class DriveOutcome:
    """Outcome of one drive."""

    km: float
    """Distance driven by the ego vehicle."""
    seconds: float
    """Duration of the drive."""
    failures: Mapping[str, tuple[Failure, ...]]
    """Failures by variant."""


def run(case: Kilometre) -> DriveOutcome:
    """Run each variant on the same frames of one drive."""
    warm_up()
    scene = traffic.scenario(case.seed, case.number)
    params = [with_changes(Params(), VARIANTS[name]) for name in case.variants]
    states = [State() for _ in params]
    judges = [Judge(scene, 1.0 / scene.rate_hz) for _ in params]
    first_m = last_m = last_s = 0.0
    for now, frame in frames(scene):
        first_m, last_m, last_s = (now.s_m if frame.index == 0 else first_m), now.s_m, now.t_s
        for n, each in enumerate(params):
            states[n], result = step(states[n], frame, each)
            judges[n].take(now, frame.camera, result)
        if judges[0].is_over:
            break
    failures = {name: tuple(judge.failures) for name, judge in zip(case.variants, judges, strict=True)}
    return DriveOutcome((last_m - first_m) / 1000.0, last_s, failures)


def suite(km: int, seed: int = 0, ablation: bool = False) -> Experiment[Kilometre, DriveOutcome]:
    """The suite with ``km`` kilometres; with ``ablation``, each rule is also switched off in turn."""
    return Experiment(
        "robustness", "robustness", "Robustness", partial(_cases, km, seed, ablation), run, report, as_drive
    )


def _cases(km: int, seed: int, ablation: bool, short: bool) -> list[Kilometre]:
    variants = tuple(VARIANTS) if ablation else (AS_IS,)
    return [Kilometre(seed, number, variants) for number in range(min(km, _SHORT_KM) if short else km)]


def as_drive(case: Kilometre, outcome: DriveOutcome) -> ExperimentDrive | None:
    """The drive, if something failed in it; otherwise None."""
    failures = outcome.failures[AS_IS]
    if not failures:
        return None
    scene = traffic.scenario(case.seed, case.number)
    return ExperimentDrive(
        _name(case),
        f"{scene.title}: {', '.join(dict.fromkeys(each.kind for each in failures))}",
        tuple(
            f"Frame {round(each.from_s * scene.rate_hz)} ({each.from_s:.1f}–{each.to_s:.1f} s): {_told(each)}"
            for each in failures
        ),
        scene,
        Params(),
        scene.sensors,
        (),
        scene.detections,
    )


def _name(case: Kilometre) -> str:
    return f"robustness_{case.seed}_{case.number:05d}"


def _told(failure: Failure) -> str:
    cause = f" ({failure.cause})" if failure.cause else ""
    return f"{failure.kind}{cause}: {failure.text}"


def report(cases: Sequence[Kilometre], outcomes: Sequence[DriveOutcome]) -> ReportSection:
    km, hours = sum(each.km for each in outcomes), sum(each.seconds for each in outcomes) / 3600.0
    counts = _counts(outcomes, AS_IS)
    tables = [
        Table(
            "Failures per 1,000 km",
            ("failure", "count", "per 1,000 km", "95 % low", "95 % high", "allowed"),
            tuple((kind, counts[kind], *_rate(counts[kind], km), ALLOWED.get(kind)) for kind in KINDS),
            "Exact bounds of a Poisson rate (Garwood 1936).",
        ),
        Table("By cause", ("failure", "cause", "count"), tuple(_causes(outcomes))),
        Table(
            "By road and event",
            ("drives with", "km", *KINDS),
            tuple(_by_layout(cases, outcomes)),
            "Counts.",
            decimals=1,
        ),
        Table("Where", ("drive", "from s", "duration s", "what"), tuple(_where(cases, outcomes)), decimals=1),
    ]
    variants = list(outcomes[0].failures) if outcomes else []
    if len(variants) > 1:
        rows: tuple[tuple[AnyCell, ...], ...] = tuple(
            (name, *(_counts(outcomes, name)[kind] for kind in KINDS)) for name in variants
        )
        tables.insert(1, Table("One rule switched off at a time", ("variant", *KINDS), rows, f"Counts in {km:.0f} km."))
    return ReportSection(
        "robustness",
        "Robustness: random traffic",
        (
            f"{len(outcomes)} drives, {km:.1f} km in {hours:.2f} h of streets, country roads and motorways, each with "
            "its own sensor faults. Camera boxes are ground truth with the errors measured for a detector on real "
            "images, false positives included. Phantom: reported where no vehicle is in the driven path or enters it "
            "within 3 s. Misplaced: the lead's image box is that of a vehicle in the path whose true range differs by "
            "more than a fifth. Missed, late: a visible true lead within 60 m that is not chosen for more than 0.5 s.",
        ),
        tuple(tables),
        failures=tuple(_unmet(counts, km)),
    )


def _counts(outcomes: Sequence[DriveOutcome], variant: str) -> Counter[str]:
    return Counter(each.kind for outcome in outcomes for each in outcome.failures[variant])


def _rate(count: int, km: float) -> tuple[float, float, float]:
    """The rate per 1,000 km, with its lower and upper bound."""
    low, high = poisson_bounds(count)
    return tuple(1000.0 * each / max(km, 1e-9) for each in (count, low, high))  # type: ignore[return-value]


def poisson_bounds(count: int, confidence: float = _CONFIDENCE) -> tuple[float, float]:
    """Exact confidence interval of the mean of a Poisson variable that was observed once as ``count`` (Garwood
    1936)."""
    from scipy.stats import chi2  # takes half a second to import; only reports need it

    tail = (1.0 - confidence) / 2.0
    low = float(chi2.ppf(tail, 2 * count)) / 2.0 if count else 0.0
    return low, float(chi2.ppf(1.0 - tail, 2 * count + 2)) / 2.0


def _unmet(counts: Counter[str], km: float) -> Iterator[str]:
    for kind, allowed in ALLOWED.items():
        if _rate(counts[kind], km)[1] > allowed:
            yield f"{kind}: {counts[kind]} in {km:.0f} km, significantly more than {allowed:g} per 1,000 km."


def _causes(outcomes: Sequence[DriveOutcome]) -> Iterator[tuple[AnyCell, ...]]:
    by_cause = Counter((each.kind, each.cause) for outcome in outcomes for each in outcome.failures[AS_IS])
    for kind in KINDS:
        found = [(cause, count) for (of, cause), count in by_cause.items() if of == kind]
        yield from ((kind, cause, count) for cause, count in sorted(found, key=lambda each: (-each[1], each[0])))


def _by_layout(cases: Sequence[Kilometre], outcomes: Sequence[DriveOutcome]) -> Iterator[tuple[AnyCell, ...]]:
    pairs = [(road_kinds.layout_of(case.seed, case.number)[1], got) for case, got in zip(cases, outcomes, strict=True)]
    parts = {
        place.name: [got for layout, got in pairs if layout.place == place.name] for place in road_kinds.ROAD_KINDS
    }
    for flag in ("lead", "cut_in", "crossing", "bends", "crests", "roadworks"):
        parts[flag.replace("_", "-")] = [got for layout, got in pairs if getattr(layout, flag)]
    for name, got in parts.items():
        counts = _counts(got, AS_IS)
        yield name, sum(each.km for each in got), *(counts[kind] for kind in KINDS)


def _where(cases: Sequence[Kilometre], outcomes: Sequence[DriveOutcome]) -> Iterator[tuple[AnyCell, ...]]:
    """Rows of failures, the worst first. Switches of the lead are not listed."""
    found = [
        (KINDS.index(each.kind), -each.lasts_s, case.number, case, each)
        for case, outcome in zip(cases, outcomes, strict=True)
        for each in outcome.failures[AS_IS]
        if each.kind != "switch"
    ]
    for _, _, _, case, each in sorted(found, key=lambda row: row[:3])[:_WORST]:
        yield Driven(case.number, _name(case)), each.from_s, each.lasts_s, _told(each)
