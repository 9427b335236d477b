"""The headless pipeline."""

import os

# onnxruntime reports usage to its maker unless this is set when it is first imported; its disable_telemetry_events()
# comes too late for the first lookup. Here, since every module that imports it, in any order, is below this package.
os.environ["ORT_DISABLE_TELEMETRY"] = "1"
