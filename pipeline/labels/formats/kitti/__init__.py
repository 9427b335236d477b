"""KITTI object and tracking labels."""
