"""How the pipeline sees real cars that were put into a real, empty street (``tests.accuracy.inserted_cars``).

    CIPV_DATA=… python -m tests.soak.inserted_cars [--only "stands 60 m ahead,…"] [--sensors both,camera]

Prints a row of a Markdown table for each manoeuvre: for each of three cars, how far it was when it became the lead, and
in how many frames after that it was not; the mean and largest error of its distance as the lead; the strongest braking.
"""

from __future__ import annotations

import argparse

import numpy as np

from pipeline.warm_up import warm_up
from tests.accuracy.inserted_cars.cut_outs import CARS
from tests.accuracy.inserted_cars.manoeuvres import MANOEUVRES, Seen, seen

_IS_IT_M, _IS_IT = 2.0, 0.2
"""A lead is the car if its distance is wrong by no more than the first, or this share of it."""


def is_lead(frame: Seen) -> bool:
    """Whether the car is the CIPV."""
    lead = frame.result.cipv
    return lead is not None and abs(lead.distance_m - frame.distance_m) < max(_IS_IT_M, _IS_IT * frame.distance_m)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default=",".join(MANOEUVRES))
    parser.add_argument("--sensors", default="both,camera")
    options = parser.parse_args()
    warm_up()
    print("| manoeuvre | sensors | lead from, m (frames without it after that) | error: mean, largest | braking |")
    print("|---|---|---|---|---|")
    for manoeuvre in options.only.split(","):
        cars = [car for car in CARS if (car == "oncoming SUV") == (manoeuvre == "comes towards us")]
        for sensors in options.sensors.split(","):
            drives = [seen(manoeuvre, car, sensors) for car in cars]
            print(f"| {manoeuvre} | {sensors} | {' · '.join(map(_led, drives))} | {_errors(drives)} |", flush=True)
    return 0


def _led(drive: list[Seen]) -> str:
    """Where the car became the lead."""
    judged = [frame for frame in drive if frame.in_path]
    leads = [is_lead(frame) for frame in judged]
    if not any(leads):
        phantoms = sum(frame.result.cipv is not None for frame in drive)
        return f"never ({phantoms} frames with a lead)" if not judged else "never"
    first = leads.index(True)
    return f"{judged[first].distance_m:.0f} ({len(leads) - first - sum(leads)})"


def _errors(drives: list[list[Seen]]) -> str:
    errors = [
        abs(frame.result.cipv.distance_m - frame.distance_m)
        for drive in drives
        for frame in drive
        if frame.in_path and frame.result.cipv is not None and is_lead(frame)
    ]
    brake = max(
        (frame.result.acc.brake for drive in drives for frame in drive if frame.result.acc is not None), default=0.0
    )
    found = f"{np.mean(errors):.1f} m, {np.max(errors):.1f} m" if errors else "–"
    return f"{found} | {100 * brake:.0f} %"


if __name__ == "__main__":
    raise SystemExit(main())
