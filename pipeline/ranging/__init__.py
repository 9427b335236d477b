"""Sensors that measure range besides the LiDAR, such as a radar: each is one module with a tracker, named in
``pipeline.types.sensors``."""
