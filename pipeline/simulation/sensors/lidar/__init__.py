"""The simulated LiDAR: its model, its rays and what they hit."""
