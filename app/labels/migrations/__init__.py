"""The schema's history: every form that the tables have had."""

HEAD = "0001"
"""The revision that this program works with."""
