"""Recordings in the formats of others, written for tests."""
