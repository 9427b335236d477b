"""The tables of a batch: each column is declared once, with its unit and meaning. docs/reference/fleet-tables.md is
generated from these declarations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    import pyarrow as pa

ColumnType = Literal["bool", "int32", "int64", "float32", "float64", "string"]


@dataclass(frozen=True)
class Column:
    """One column. Missing is null."""

    name: str
    """As conditions of `cipv find` write it; ends in the unit where there is one."""
    kind: ColumnType
    """Apache Arrow's name of the type."""
    unit: str
    """For the reference page, e.g. ``m/s``; empty without one."""
    about: str
    """The meaning, in a phrase for the reference page."""


@dataclass(frozen=True)
class TableShape:
    """One table of a batch."""

    name: str
    """What SQL calls it, and the folder of its files below ``tables`` and ``packed``."""
    about: str
    """What a row is, in sentences for the reference page."""
    columns: tuple[Column, ...]
    """In the order of the file; packs have ``drive`` before them."""

    def schema(self) -> pa.Schema:
        """Type name in pyarrow."""
        import pyarrow as pa

        return pa.schema([pa.field(each.name, pa.type_for_alias(each.kind)) for each in self.columns])


def _columns(*rows: tuple[str, ColumnType, str, str]) -> tuple[Column, ...]:
    return tuple(Column(*row) for row in rows)


_AT: Sequence[tuple[str, ColumnType, str, str]] = (
    ("index", "int32", "", "Number of the frame in the recording, from 0"),
    ("t_ns", "int64", "ns", "The frame's tick"),
)

FRAMES = TableShape(
    "frames",
    "One row per frame: the CIPV, ego motion and control.",
    _columns(
        *_AT,
        ("t_s", "float64", "s", "Time since the first frame of the recording"),
        ("name", "string", "", "The frame's name in the recording"),
        ("cipv_id", "int32", "", "The closest in-path vehicle"),
        ("source", "string", "", "Sensors that track the CIPV: `V`, `L` or `VL`"),
        ("carried", "bool", "", "Whether the CIPV is a prediction, not seen in this frame"),
        ("distance_m", "float32", "m", "Distance of the CIPV"),
        ("distance_sigma_m", "float32", "m", "Standard deviation of the CIPV's distance"),
        ("closing_speed_mps", "float32", "m/s", "How fast the gap to the CIPV shrinks"),
        ("ttc_s", "float32", "s", "Time to collision with the CIPV"),
        ("path_offset_m", "float32", "m", "Offset of the CIPV from the path's centre, positive to the left"),
        ("vl_gap_m", "float32", "m", "The camera's distance of the CIPV minus the LiDAR's"),
        ("vl_gap_sigmas", "float32", "", "The size of that gap in standard deviations of both sensors"),
        ("speed_mps", "float32", "m/s", "Ego speed"),
        ("yaw_rate_radps", "float32", "rad/s", "Ego yaw rate, positive to the left"),
        ("desired_speed_mps", "float32", "m/s", "Speed given by the speed law of ACC"),
        ("accel_mps2", "float32", "m/s²", "Acceleration requested by ACC or emergency braking"),
        ("brake", "float32", "", "Pedal, 0–1"),
        ("acc_state", "string", "", "State of ACC and emergency braking"),
        ("gaps", "string", "", "Sensors without data in this frame, joined by commas"),
        ("reach_m", "float32", "m", "How far ahead a vehicle in the path would be detected"),
        ("path_source", "string", "", "Source of the path"),
        ("objects", "int32", "", "Number of objects"),
        ("notes", "string", "", "What is missing or wrong, in sentences"),
    ),
)
OBJECTS = TableShape(
    "objects",
    "One row per object and frame, nearest first.",
    _columns(
        *_AT,
        ("id", "int32", "", "Id of the object, stable from frame to frame"),
        ("cipv", "bool", "", "Whether it is the CIPV"),
        ("source", "string", "", "Sensors that track it: `V`, `L` or `VL`"),
        ("seen_by", "string", "", "Sensors that saw it in this frame; empty: it is carried"),
        ("type", "string", "", "Its class, from the camera"),
        ("type_score", "float32", "", "The detector's score for that class, 0–1"),
        ("distance_m", "float32", "m", "Distance to its nearest point"),
        ("distance_sigma_m", "float32", "m", "Standard deviation of the distance"),
        ("distance_from", "string", "", "Source of the distance: `cluster`, `returns` or `box`"),
        ("height_from", "string", "", "Camera alone: source of its height: `class`, `shape`, `road` or `range`"),
        ("closing_speed_mps", "float32", "m/s", "How fast the gap shrinks"),
        ("ttc_s", "float32", "s", "Time to collision"),
        ("speed_over_ground_mps", "float32", "m/s", "Its own speed"),
        ("moving", "bool", "", "Whether it moves relative to the ground"),
        ("in_path", "bool", "", "Whether its probability of being in the path is above 0.5"),
        ("in_path_probability", "float32", "", "0–1"),
        ("existence_probability", "float32", "", "0–1"),
        ("path_offset_m", "float32", "m", "From the path's centre, positive to the left"),
        ("vl_gap_m", "float32", "m", "The camera's distance minus the LiDAR's"),
        ("vl_gap_sigmas", "float32", "", "The size of that gap in standard deviations of both sensors"),
        ("x_m", "float32", "m", "x of its nearest point, ego frame"),
        ("y_m", "float32", "m", "y of its nearest point, ego frame"),
        ("vx_mps", "float32", "m/s", "Velocity relative to ego, forwards"),
        ("vy_mps", "float32", "m/s", "Velocity relative to ego, to the left"),
        ("bbox_x1", "float32", "px", "Left edge of its image box"),
        ("bbox_y1", "float32", "px", "Upper edge of its image box"),
        ("bbox_x2", "float32", "px", "Right edge of its image box"),
        ("bbox_y2", "float32", "px", "Lower edge of its image box"),
        ("length_m", "float32", "m", "Length of its cuboid"),
        ("width_m", "float32", "m", "Width of its cuboid"),
        ("height_m", "float32", "m", "Height of its cuboid"),
        ("yaw_rad", "float32", "rad", "Yaw of its cuboid"),
        ("hits", "int32", "", "Sightings so far"),
        ("lidar_points", "int32", "", "Points of its last cluster"),
    ),
)
EVENTS = TableShape(
    "events",
    "One row per event, with the CIPV at that time and around it.",
    _columns(
        *_AT,
        ("t_s", "float64", "s", "Time since the first frame of the recording"),
        ("kind", "string", "", "What happened: `cut_in`, `cut_out`, `cipv_switch`, …"),
        ("severity", "string", "", "`info`, `notice`, `warning` or `alarm`"),
        ("text", "string", "", "What happened, in a sentence"),
        ("id", "int32", "", "The object it is about"),
        ("other_id", "int32", "", "The second object it is about"),
        ("source", "string", "", "Sensors that track the CIPV"),
        ("distance_m", "float32", "m", "Distance of the CIPV"),
        ("closing_speed_mps", "float32", "m/s", "Closing speed of the CIPV"),
        ("ttc_s", "float32", "s", "Time to collision with the CIPV at the event"),
        ("min_ttc_s", "float32", "s", "Shortest time to collision within 3 s after the event"),
        (
            "max_gap_m",
            "float32",
            "m",
            "Largest gap between the camera's and the LiDAR's distance of the CIPV within 2 s",
        ),
        ("max_gap_sigmas", "float32", "", "Largest such gap in standard deviations within 2 s"),
        ("speed_mps", "float32", "m/s", "Ego speed"),
        ("yaw_rate_radps", "float32", "rad/s", "Ego yaw rate, positive to the left"),
        ("accel_mps2", "float32", "m/s²", "Acceleration requested by ACC or emergency braking"),
    ),
)
SCORES = TableShape(
    "scores",
    "One row per score of a drive. A score of several drives is the sum of `over` divided by the sum of `under`.",
    _columns(
        ("score", "string", "", "Its name; those that begin with `labelled.` compare with the recording's labels"),
        ("value", "float64", "", "`over` divided by `under`; null where `under` is zero"),
        ("over", "float64", "", "What the drive adds to the numerator"),
        ("under", "float64", "", "What the drive adds to the denominator"),
    ),
)
TIMINGS = TableShape(
    "timings",
    "One row per frame and stage. The only table that differs from run to run.",
    _columns(
        ("index", "int32", "", "Number of the frame"),
        ("stage", "string", "", "Stage of the pipeline; `total` is the whole step"),
        ("ms", "float32", "ms", "How long it took"),
    ),
)
DRIVES = TableShape(
    "drives",
    "One row per drive.",
    _columns(
        ("address", "string", "", "Address that `cipv serve` and `cipv run` open"),
        ("title", "string", "", "Title of the recording"),
        ("mark", "string", "", "Fingerprint of the recording's files"),
        ("frames", "int32", "", "Number of frames"),
        ("duration_s", "float64", "s", "From the first frame to the last"),
        ("began_ns", "int64", "ns", "Tick of the first frame"),
        ("mean_speed_mps", "float32", "m/s", "Mean ego speed"),
        (
            "mean_bend_radpm",
            "float32",
            "rad/m",
            "Mean absolute curvature driven: yaw rate divided by speed, above 3 m/s",
        ),
        ("mean_lead_m", "float32", "m", "Mean distance of the CIPV"),
        ("frames_with_lead", "int32", "", "Frames with a CIPV"),
        ("labelled_frames", "int32", "", "Frames with labels"),
        ("brightness", "float32", "", "Mean brightness of the first image, 0–255"),
    ),
)

TABLES = (DRIVES, FRAMES, OBJECTS, EVENTS, SCORES, TIMINGS)
"""Every table, in the order of the reference page."""
EQUAL_TABLES = tuple(table for table in TABLES if table is not TIMINGS)
"""Those that equal inputs give in equal bytes."""


def file_of(table: str, run: str, drive: str) -> str:
    """The name, in the batch's store, of a drive's part of a table."""
    return f"tables/{table}/run={run}/drive={drive}/part.parquet"
