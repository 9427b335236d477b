"""Cuboids from points: one sweep or several laid over each other, snapped, refined, carried on."""
