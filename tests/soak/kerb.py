"""What ACC and emergency braking do for people who come to the kerb and stop there.

    python -m tests.soak.kerb [--kmh 30,50]

A pedestrian walks or runs up to a straight street, where the path is the middle of the lane, and stops beside it before
the car is there, from the right at three times and from the left at one. The loop is closed, boxes are given. Prints a
row of a Markdown table for each place where they stop: in how many of the drives the car braked, in how many of these
emergency braking took part, and the largest loss of speed.
"""

from __future__ import annotations

import argparse
from typing import NamedTuple

from pipeline.experiments.straight_track import parameters
from pipeline.simulation import scenario
from pipeline.simulation.closed_loop import Setup, drive
from pipeline.warm_up import warm_up

LANE_M, MEETS_S = 3.5, 8.0
WALKS_S, SLOWS_S = 3.0, 1.0
"""How long they walk before they stop, and within which time they stop: two steps, the fastest that is usual."""
STOPS_M = (1.3, 1.6, 1.9, 2.3, 2.8, 3.5)
"""Distance from the middle of the path at which they stop; the lane ends at 1.75 m, the car at 0.9 m."""
SPEEDS = {"walks at 1.4 m/s": 1.4, "runs at 2.5 m/s": 2.5}
FROM = ((-1.0, 2.5), (-1.0, 1.5), (-1.0, 0.7), (1.0, 1.5))
"""Side from which they come, and how long before the car they stop."""
_BRAKES = 0.05


class Driven(NamedTuple):
    """One drive."""

    braked: bool
    emergency: bool
    lost_kmh: float


def driven(speed_kmh: float, walks_mps: float, stops_m: float, side: float, before_s: float) -> Driven:
    """Drive once."""
    speed = speed_kmh / 3.6
    there_s, own_m = MEETS_S - before_s, -LANE_M / 2.0
    slows_s = there_s - SLOWS_S
    begins_s = slows_s - WALKS_S
    begins_m = own_m + side * (stops_m + walks_mps * (WALKS_S + SLOWS_S / 2.0))
    scene = scenario.parse(
        f"""
title: at the kerb
seed: 3
duration_s: 9.5
road: {{segments: [{{length_m: 2000}}], lanes_forward: 1, lanes_oncoming: 1, median_m: 0, lane_width_m: {LANE_M}}}
ego: {{lane: -1, speed_mps: {{0: {speed}}}}}
free_actors:
  - id: 1
    kind: pedestrian
    s_m: {100.0 + speed * MEETS_S}
    d_m: {begins_m}
    heading_deg: {-90.0 * side}
    speed_mps: {{0: 0, {begins_s - 0.01}: 0, {begins_s}: {walks_mps}, {slows_s}: {walks_mps}, {there_s}: 0}}
""",
        "kerb.yaml",
    )
    brake, slowest, states = 0.0, speed, set()
    for tick in drive(scene, Setup(params=parameters("ACC + AEB", speed))):
        assert tick.result.acc is not None
        brake, slowest = max(brake, tick.result.acc.brake), min(slowest, tick.world.speed_mps)
        states.add(tick.result.acc.state)
    return Driven(brake > _BRAKES, bool(states & {"partial_brake", "full_brake"}), 3.6 * (speed - slowest))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kmh", default="30,50")
    speeds = [float(each) for each in parser.parse_args().kmh.split(",")]
    warm_up()
    print("| who | stops beside the middle of the path, m | car, km/h | drives | braked | emergency | lost, km/h |")
    print("|---" * 7 + "|")
    for name, walks_mps in SPEEDS.items():
        for stops_m in STOPS_M:
            for kmh in speeds:
                found = [driven(kmh, walks_mps, stops_m, *each) for each in FROM]
                braked, emergency = sum(each.braked for each in found), sum(each.emergency for each in found)
                lost_kmh = max(each.lost_kmh for each in found)
                print(
                    f"| {name} | {stops_m} | {kmh:.0f} | {len(found)} | {braked} | {emergency} | {lost_kmh:.0f} |",
                    flush=True,
                )
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
