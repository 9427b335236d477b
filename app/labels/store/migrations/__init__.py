"""The history of the database schema."""

HEAD = "0006"
"""The revision that this program works with."""
