"""Roads of ASAM OpenDRIVE files, and the way of the ego vehicle along them as one road of the simulator."""
