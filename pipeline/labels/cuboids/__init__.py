"""Cuboids from points of one sweep or several overlaid sweeps: snapping, refining, extending tracks."""
