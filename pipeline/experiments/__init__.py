"""The paper's experiments, repeated on the simulator's test track, and those that road testers use."""
