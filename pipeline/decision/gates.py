"""The conditions that an object must meet to be a lead: one function for each condition, and the judgement by all of
them.

Each condition returns yes or no with the value and the limit behind it. The results become ``Eligibility``, which
decisions read, and gates, which people read; the pipeline never uses a gate's name."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import exp, log
from typing import NamedTuple

from pipeline.decision.place import Place
from pipeline.params import CipvParams
from pipeline.types import VEHICLES, Conditions, Eligibility, FusedObject, Gate, Path

ABREAST_M = 1.0
"""An object to the side that begins nearer to the bumper than this is beside the car, which cannot be steered onto it
within a metre."""
OWN_HALF_WIDTH_M = 1.0
"""Half the width of a passenger car without mirrors (1.8 to 2 m)."""
_KNOWN_M = 0.5
"""If the LiDAR has just lost an object, its predicted distance counts as measured up to this standard deviation, which
is small against any gap that control keeps."""
ON_A_VAGUE_PATH = 0.25
"""Factor on ``max_sigma_m`` if the path is not usable. By default this leaves one metre: an object estimated to be in
the middle of a lane 3.5 m wide is then in it with 92 %."""
_CLEARLY_M = 0.5
"""An object's middle and a lane line are each known to a few decimetres: what is this far inside is not at the edge."""
STAYS_UP_TO = 1.5
"""Factor on ``max_sigma_m`` for the current lead: hysteresis, so that a lead whose uncertainty is close to the limit
does not come and go."""


class Candidate(NamedTuple):
    """An object with everything needed to check its conditions."""

    item: FusedObject
    """The object."""
    place: Place | None
    """Its position relative to the path; None if not known."""
    odds: float
    """Running mean of the log-odds that it is in the path."""
    leads: bool
    """Whether it was the lead in the previous frame."""
    widening_m: float
    """How much wider the path is for it, on either side."""
    path: Path
    """The path ahead."""
    params: CipvParams
    """Limits of the conditions."""
    clears_path_s: float | None = None
    """How long before the car arrives it will have left the path that it crosses; None if it does not."""
    has_driven: bool = False
    """Whether it was seen to drive for long enough that it did not only seem to."""
    was_ours: bool = False
    """Whether it was seen to drive in our lane for as long."""
    was_boxed: bool = False
    """Whether both sensors saw it, the camera as a vehicle, for long enough that it is one."""

    @property
    def least_odds(self) -> float:
        """Log-odds above which it counts as in the path: even ones, and lower ones for the current lead."""
        stays = self.stay_probability
        return min(log(stays / (1.0 - stays)), 0.0) if self.leads and stays > 0.0 else 0.0

    @property
    def stay_probability(self) -> float:
        """With which probability of being in the path it remains the lead. A vehicle that surely drove in our lane
        stays in it almost always, but a path without lines or a route may be off by metres at 40 m as a bend begins.
        docs/reference/accuracy.md says on which streets its limit was chosen, and on which it was checked."""
        keeps_lane = self.was_ours and self.place is not None and self.place.drives_along
        return self.params.stay_driving if keeps_lane else self.params.stay_probability

    @property
    def is_in_path(self) -> bool:
        """Whether it counts as in the path."""
        return self.odds > self.least_odds

    @property
    def aside_m(self) -> float:
        """Its distance from the middle of the path: as measured now, unless its earlier sightings contradict it; then
        the offset that corresponds to the running mean."""
        assert self.place is not None
        margin_m = self.place.margin_m(self.widening_m)
        if (margin_m >= self.place.margin_of(self.least_odds)) == self.is_in_path:
            return abs(self.place.middle_m)
        return self.place.limit_m + self.widening_m - self.place.margin_of(self.odds)


Answer = tuple[bool, float | None, float]
"""Whether a condition is met, the value that decided it (None without one), and its limit."""


class Condition(NamedTuple):
    """One condition that a lead must meet."""

    shown_as: str
    """Name of its gate, for display only."""
    check: Callable[[Candidate], Answer]
    """Checks a candidate; returns the answer with value and limit."""
    why_not: Callable[[Candidate], str]
    """Returns the sentence that says why it failed. Used only for an object's first failure."""


class GateVerdict(NamedTuple):
    """The result of checking one candidate."""

    eligibility: Eligibility
    """Which conditions it meets; used by decisions."""
    gates: tuple[Gate, ...]
    """The same with values and limits, for display."""
    why_not: str | None
    """Why it cannot be the lead; None if it can."""


def judge(who: Candidate) -> GateVerdict:
    """Check one object against every condition of a lead."""
    names, checks, _ = zip(*CONDITIONS, strict=True)
    met, values, limits = zip(*[check(who) for check in checks], strict=True)
    eligibility = _conditions(met)
    gates = tuple(map(_gate, zip(names, values, limits, met, strict=True)))
    why_not = None if all(eligibility) else CONDITIONS[eligibility.index(False)].why_not(who)
    return GateVerdict(eligibility, gates, why_not)


def is_solid(item: FusedObject) -> bool:
    """Whether an object certainly exists now and is large enough to matter, whatever its class and position."""
    found = item.eligibility
    return found is not None and found.distance and found.confirmed and found.seen and found.size


def _vehicle(who: Candidate) -> Answer:
    """An object with a class must be a vehicle; one without is judged by its size."""
    label = who.item.label
    return label is None or label in VEHICLES, None, 1.0


def _distance(who: Candidate) -> Answer:
    distance_m = who.item.distance_m
    return distance_m is not None, distance_m, 0.0


def _confirmed(who: Candidate) -> Answer:
    """Two sensors that both see it now confirm it at once; a single sensor must see it several times. The previous lead
    counts as confirmed while it is seen: a false box on a stray cluster is gone in the next frame."""
    stays_lead = who.leads and not (who.item.carried and who.params.confirm_lead)
    at_once = who.item.seen_by_two_sensors or stays_lead
    hits, needed = _sightings(who.item), 1 if at_once else who.params.confirm_hits
    return hits >= needed, hits, needed


def _sightings(item: FusedObject) -> int:
    """Number of sightings of the object at its current position. A camera track whose position was reset, because its
    distances no longer fitted, may now follow another vehicle, so only the sightings since then count."""
    return min(item.hits, item.camera_ranges) if item.imaged and not item.ranged else item.hits


def _seen(who: Candidate) -> Answer:
    """If an object's distance was not measured in this frame, it may remain the lead, which prevents flicker, but may
    not become the lead, because its current position is only predicted. An object that the camera sees and the LiDAR
    has just lost still counts as known."""
    item = who.item
    just_lost = item.ranged and item.seen_by_camera and not item.ranged_now
    followed = just_lost and (item.distance_sigma_m or 0.0) < _KNOWN_M
    known = not item.carried and (item.measured or followed)
    return known or who.leads or who.params.carried_may_become_lead, float(known), 0.0 if who.leads else 1.0


def _not_seen(who: Candidate) -> str:
    return "not seen in this frame" if who.item.carried else "distance not measured in this frame"


def _size(who: Candidate) -> Answer:
    """An object that no camera has classified must be as large as a vehicle's rear or side: kerbs, posts and hedges are
    not leads. The shorter side of a vehicle's box is at most 2.6 m (Directive 96/53/EC), or more if the box is askew by
    20° to 6 m of its flank. A larger one holds several vehicles, such as a passing bus, the lead and a parked car."""
    item, params = who.item, who.params
    if item.imaged or who.was_boxed or item.cuboid is None:
        return True, None, params.min_width_m
    length, width, height = item.cuboid.size
    across = length if length > width else width
    if across < params.min_width_m:
        return False, across, params.min_width_m
    if height < params.min_height_m:
        return False, height, params.min_height_m
    if min(length, width) > params.max_short_side_m:
        return False, min(length, width), params.max_short_side_m
    return across <= params.max_size_m, across, params.max_size_m


def _wrong_size(who: Candidate) -> str:
    length, width, height = who.item.cuboid.size if who.item.cuboid is not None else (0.0, 0.0, 0.0)
    across = max(length, width)
    if across < who.params.min_width_m:
        return f"only {across:.1f} m wide"
    if height < who.params.min_height_m:
        return f"only {height:.1f} m high"
    return f"{length:.0f} by {width:.0f} m: not a vehicle"


def _ahead(who: Candidate) -> Answer:
    """Measured along the path from the bumper. An object farther to the side than half the car's width counts as beside
    it until it is somewhat farther ahead: the car cannot be steered onto it within that distance."""
    if who.place is None:
        return False, None, 0.0
    limit_m = 0.0 if abs(who.place.offset_m) <= OWN_HALF_WIDTH_M else ABREAST_M
    return who.place.ahead_m > limit_m, who.place.ahead_m, limit_m


def _stays(who: Candidate) -> Answer:
    """What crosses is in the path only if it is still there when the car arrives."""
    return who.clears_path_s is None, who.clears_path_s, who.params.crossing_margin_s


def _in_path(who: Candidate) -> Answer:
    """The running mean of the log-odds, expressed in metres: see ``aside_m``. The lead leaves the path once it is
    probably outside: in a bend, a car whose distance is uncertain by a fifth may seem to be beside it."""
    if who.place is None:
        return False, None, who.path.half_width_m
    limit_m = who.place.limit_m + who.widening_m - who.place.margin_of(who.least_odds)
    return who.is_in_path, who.aside_m, limit_m


def _out_of_path(who: Candidate) -> str:
    if who.place is None:
        return "position unknown"
    outside_m = -who.place.margin_m(who.widening_m)
    return f"out of path by {outside_m:.1f} m" if outside_m > 0.0 else "in path only briefly"


def _placed(who: Candidate) -> Answer:
    """Far ahead, the uncertainty of an object's position relative to the path may exceed a lane's width, so it cannot
    be called in the path. If the path is too uncertain to drive by, only objects where the path is known well may
    lead."""
    limit = who.params.max_sigma_m * (STAYS_UP_TO if who.leads else 1.0)
    limit *= 1.0 if who.path.usable else ON_A_VAGUE_PATH
    sigma = who.place.sigma_m if who.place is not None else 0.0
    return sigma <= limit, sigma, limit


def _uncertain(who: Candidate) -> str:
    return f"lateral position uncertain by {who.place.sigma_m if who.place is not None else 0.0:.1f} m"


def _probable(who: Candidate) -> Answer:
    """Probability that it exists, and that it exists in the path. It is below a half for a weak box without other
    support, and for a car 60 m straight ahead on a road that may bend either way; if both are just above a half, the
    product is not. The current lead was seen in the path while that was known well enough, so only the side of the edge
    on which it is now is checked.

    For a new lead, the required probability of existence is higher than that of being in the path: braking for a false
    object is worse than braking for a car beside the path, and far away no position is certain. Standing vehicles must
    be in the path with a higher probability: of 43 standing vehicles within 40 m on two KITTI drives, 2 were. So must
    what only the LiDAR sees: a wall or a hedge that comes into view bit by bit seems to move. Oncoming
    traffic must be in it almost certainly: its drivers keep clear of us, and before a bend is known, oncoming cars seem
    to come straight at us.

    What only the camera sees at the edge of the path must be in it more surely. On 33 random roads
    (``pipeline.experiments.robustness``), such objects led with less than 70 % in 87 frames, and 79 of them were
    phantoms (59 of 60 on the 18 roads first looked at, 20 of 27 on the others), most of them a track that hopped along
    a row of parked cars in a bend, as if it drove ahead. A lead may stay with less: in a bend of 125 m without a route,
    true leads fall below 60 %. Clearly inside, a low probability only says that the road is not known.
    """
    there, in_path = _existence(who), _in_path_probability(who) if who.is_in_path else 1.0
    # objects out of the path already fail another gate
    to_exist, to_be_in_path = _needed_existence(who), _needed_probability(who)
    probability = in_path if who.leads else there * in_path
    # the one that is missed by more is shown
    if there - to_exist <= probability - to_be_in_path:
        return there >= to_exist, there, to_exist
    return probability >= to_be_in_path, probability, to_be_in_path


def _existence(who: Candidate) -> float:
    return who.item.existence if who.item.existence is not None else 1.0


def _needed_existence(who: Candidate) -> float:
    return who.params.stay_probability if who.leads else who.params.become_existence


def _needed_probability(who: Candidate) -> float:
    """The probability that is required of being in the path: the highest that applies."""
    item, params = who.item, who.params
    if who.leads:
        was_parked = _may_stand(item) and not who.has_driven
        return max(who.stay_probability, params.stay_standing if was_parked else 0.0)
    return max(
        params.become_probability,
        params.become_oncoming if item.oncoming else 0.0,
        params.become_standing if _may_stand(item) and not item.oncoming else 0.0,
        params.become_camera if _is_at_edge_by_camera(who) else 0.0,
    )


def _is_at_edge_by_camera(who: Candidate) -> bool:
    return not who.item.ranged and who.place is not None and who.place.margin_m() < _CLEARLY_M


def _may_stand(item: FusedObject) -> bool:
    return item.surely_moving is not None and not (item.surely_moving and item.imaged)


def _in_path_probability(who: Candidate) -> float:
    if who.leads or who.place is None:
        return 1.0 / (1.0 + exp(-who.odds))
    return who.place.probability(who.widening_m)


def _improbable(who: Candidate) -> str:
    there = _existence(who)
    if there < _needed_existence(who):
        return f"only {100 * there:.0f} % likely to exist"
    in_path = _in_path_probability(who)
    needed = _needed_probability(who)
    if in_path < needed:
        return f"only {100 * in_path:.0f} % likely to be in path"
    return f"only {100 * there * in_path:.0f} % likely to exist and be in path"


CONDITIONS = Conditions(
    vehicle=Condition("vehicle_class", _vehicle, lambda who: f"class {who.item.label}"),
    distance=Condition("distance_known", _distance, lambda _: "distance unknown"),
    size=Condition("size", _size, _wrong_size),
    ahead=Condition(
        "ahead", _ahead, lambda who: "position unknown" if who.place is None else "beside or behind the bumper"
    ),
    stays=Condition(
        "clears_path_s", _stays, lambda who: f"crossing: clears the path {who.clears_path_s:.1f} s before we arrive"
    ),
    in_path=Condition("path_offset", _in_path, _out_of_path),
    confirmed=Condition(
        "hits", _confirmed, lambda who: f"seen {_sightings(who.item)} of {who.params.confirm_hits} times"
    ),
    seen=Condition("seen", _seen, _not_seen),
    placed=Condition("path_sigma", _placed, _uncertain),
    probable=Condition("lead_probability", _probable, _improbable),
)

_gate: Callable[[tuple[str, float | None, float, bool]], Gate] = partial(tuple.__new__, Gate)
_conditions: Callable[[tuple[bool, ...]], Eligibility] = partial(tuple.__new__, Conditions)
"""``Gate`` and ``Conditions`` without their Python constructors, which take three times as long: a frame may have a
thousand gates."""
