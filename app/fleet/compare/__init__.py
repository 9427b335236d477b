"""Compares two runs over the same drives: what improved, what got worse, and whether that is acceptable."""
