"""Scores of a drive without labels, from what became known of its objects later."""
