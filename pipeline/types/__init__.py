"""What flows along the line: one ``Frame`` in, one ``Result`` out, and the values handed from stage to stage.

Frames of reference: the *ego frame* is x forward, y left, z up, metres, origin named by the source. The image is
u right, v down, pixels. Times are nanoseconds of the sensors' own clock. Every class is frozen; arrays inside are
treated as read-only. What a frame makes by the hundred is a named tuple, which costs a fraction of a data class.
"""

from pipeline.types.arrays import F32, F64, I32, I64, U8, VEHICLES, Box, Mask, Point2, Point3, SourceKind
from pipeline.types.frame import (
    CameraCalibration,
    EgoState,
    Frame,
    GnssFix,
    GnssQuality,
    Picture,
    RawBoxes,
    RawLanes,
    Route,
    StreamHealth,
    Sweep,
)
from pipeline.types.objects import (
    Detection,
    FusedObject,
    Gate,
    Ground,
    LidarTrack,
    Obstacle,
    VisionMeasurement,
    VisionTrack,
)
from pipeline.types.result import (
    DROPPED,
    GROUND,
    UNCLUSTERED,
    AccCommand,
    Cipv,
    Layers,
    Path,
    PathSource,
    Rejection,
    Result,
    SensorHealth,
)

__all__ = [
    "DROPPED",
    "F32",
    "F64",
    "GROUND",
    "I32",
    "I64",
    "U8",
    "UNCLUSTERED",
    "VEHICLES",
    "AccCommand",
    "Box",
    "CameraCalibration",
    "Cipv",
    "Detection",
    "EgoState",
    "Frame",
    "FusedObject",
    "Gate",
    "GnssFix",
    "GnssQuality",
    "Ground",
    "Layers",
    "LidarTrack",
    "Mask",
    "Obstacle",
    "Path",
    "PathSource",
    "Picture",
    "Point2",
    "Point3",
    "RawBoxes",
    "RawLanes",
    "Rejection",
    "Result",
    "Route",
    "SensorHealth",
    "SourceKind",
    "StreamHealth",
    "Sweep",
    "VisionMeasurement",
    "VisionTrack",
]
