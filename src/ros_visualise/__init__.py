"""See what a robot sees: sensor data through nodes with live sliders, in a browser or on ROS."""

import os

# Libraries read these when they are loaded. Nobody asked for what they would do without them.
os.environ["ORT_DISABLE_TELEMETRY"] = "1"  # onnxruntime reports to its makers over the network
os.environ["MESA_SHADER_CACHE_DISABLE"] = "true"  # OpenGL writes to the home folder: Mesa's ...
os.environ["__GL_SHADER_DISK_CACHE"] = "0"  # ... and NVIDIA's
