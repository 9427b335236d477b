"""Two runs over the same drives: what got better, what got worse, and whether that may pass."""
