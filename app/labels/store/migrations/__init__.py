"""The schema's history: every form that the tables have had."""

HEAD = "0004"
"""The revision that this program works with."""
