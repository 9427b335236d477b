"""The JSON tables of nuScenes."""
