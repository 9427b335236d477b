"""The history of the database schema."""

HEAD = "0007"
"""The revision that this program works with."""
