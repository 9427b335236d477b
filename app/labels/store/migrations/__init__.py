"""The schema's history: every form that the tables have had."""

HEAD = "0006"
"""The revision that this program works with."""
