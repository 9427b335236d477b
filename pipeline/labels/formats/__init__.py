"""Labels as files of other tools, and back. ``registry.FORMATS`` lists them.

base.py       what a format is and what it must know of the drive    parts.py  what a format cannot hold, in words
registry.py   all formats by name; export and import                 reading.py  files that may be anything
native.py     our own JSON, which holds everything                   session.py  labels inside an MCAP session
kitti.py      object and tracking labels; kitti_rows.py: their lines
nuscenes.py   the JSON tables; nuscenes_read.py: back
coco.py       boxes in pictures                                      lead_csv.py the lead of each frame as a table
openlabel.py  ASAM OpenLABEL 1.0; openlabel_read.py, openlabel_form.py: back
"""
