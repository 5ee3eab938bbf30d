"""Writing a recording from Python: a number, a pose and an image, for any viewer.

python examples/13_write_a_recording.py waves.mcap
ros-visualise bag waves.mcap
"""

import math
import sys

import numpy as np

from ros_visualise.data import Header, Image, Message, Number, PoseStamped
from ros_visualise.messages.recorded import TopicType
from ros_visualise.sinks import open_recorder

TOPICS: dict[str, type[Message]] = {"/height": Number, "/float": PoseStamped, "/image_raw": Image}

types = {topic: TopicType(kind.type_name) for topic, kind in TOPICS.items()}
with open_recorder(sys.argv[1], types, overwrite=True, live=False) as recording:
    columns = np.arange(160)
    for step in range(100):
        stamp_ns = step * 50_000_000
        height = math.sin(step / 8)
        wave = 40 + 20 * np.sin(columns / 12 + step / 8)
        pixels = np.where(np.arange(120)[:, None] > wave, 200, 40).astype(np.uint8)
        position, upright = np.array([0, 0, height]), np.array([0, 0, 0, 1.0])
        recording.write("/height", Number(height, Header(stamp_ns)), stamp_ns)
        recording.write("/float", PoseStamped(position, upright, Header(stamp_ns, "map")), stamp_ns)
        recording.write("/image_raw", Image(pixels, "mono8", Header(stamp_ns, "camera")), stamp_ns)
