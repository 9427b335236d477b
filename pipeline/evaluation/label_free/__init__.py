"""Scores of a drive without labels, based on what later frames reveal about its objects."""
