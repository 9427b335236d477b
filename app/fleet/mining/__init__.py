"""Finds the seconds of a fleet that are worth labeling next, and puts them into the labeling queue."""
