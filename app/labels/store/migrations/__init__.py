"""The history of the database schema."""

HEAD = "0008"
"""The schema revision of this program."""
