"""The history of the database schema."""

HEAD = "0007"
"""The schema revision of this program."""
