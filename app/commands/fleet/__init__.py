"""The commands of a fleet of recordings."""
