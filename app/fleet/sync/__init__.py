"""Copies finished sessions from a car to a store: what happened first, then everything, oldest first."""
