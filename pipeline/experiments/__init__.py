"""The paper's experiments repeated on the simulator's test track, and standard tests such as Euro NCAP's and ISO
15622."""
