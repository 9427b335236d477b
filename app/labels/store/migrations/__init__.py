"""The schema's history: every form that the tables have had."""

HEAD = "0003"
"""The revision that this program works with."""
