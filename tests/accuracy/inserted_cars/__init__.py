"""Real cars of Astyx, put into the real, empty street of KITTI 0009: manoeuvres whose truth is known, on real images
and sweeps. No recording here shows a lead between 30 and 60 m on a street without lane lines."""
