"""Projects: named sets of recordings with classes, a sampling of frames, and control frames."""
