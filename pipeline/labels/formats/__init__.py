"""Labels as files of other tools, and back. ``registry.FORMATS`` lists them.

registry.py   every format by name; export and import
base.py       what a format is, and what it must know of the recording that labels belong to
parts.py      what a format cannot hold, in words
reading.py    files with any content: one clear error
native.py     our own JSON, which holds everything
session.py    labels inside an MCAP session
openlabel/    ASAM OpenLABEL 1.0
nuscenes/     nuScenes' JSON tables
kitti/        KITTI object and tracking labels
coco.py       COCO boxes in images
lead_csv.py   the lead of each frame as a table
points.py     LiDAR points in each cuboid
"""
