"""The headless pipeline."""

import os
from pathlib import Path

from pipeline.common.files.own_folder import place_compiled_kernels

# onnxruntime reports usage to its maker unless this is set when it is first imported; its disable_telemetry_events()
# comes too late for the first lookup. Here, since every module that imports it, in any order, is below this package.
os.environ["ORT_DISABLE_TELEMETRY"] = "1"

# Here for the same reason: numba reads its settings when it is first imported.
place_compiled_kernels(Path(__file__).parent / "common")
