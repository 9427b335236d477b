"""The history of the database schema."""

HEAD = "0009"
"""The schema revision of this program."""
