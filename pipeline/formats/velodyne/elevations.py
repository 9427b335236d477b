"""The elevations of a VLP-16's sixteen lasers (Velodyne manual 63-9243, section 9.3.1.3)."""

from __future__ import annotations

import numpy as np

VLP16_ELEVATIONS_DEG = np.arange(-15.0, 16.0, 2.0)
"""(16,) float64, lowest laser first: rings are numbered in this order everywhere."""
