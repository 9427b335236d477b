"""Storyboards: entities, the actions that move them and the conditions that start these, at steps of 0.02 s."""
