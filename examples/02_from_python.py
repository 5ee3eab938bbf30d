"""The pipeline from Python: how much of each second of a video is edges?

python examples/02_from_python.py flight.mp4
"""

import sys
from collections import defaultdict

import numpy as np

import ros_visualise as rv

graph = rv.pipeline(sys.argv[1])
graph = graph.configured({"edge_detector": {"low": 50, "high": 150}, "fps_control": {"fps": 5}})
shares: dict[int, list[float]] = defaultdict(list)
for sample in rv.run(graph, "/edges", kind=rv.Image):
    shares[sample.stamp_ns // 10**9].append(float(np.mean(sample.message.pixels > 0)))
for second, values in shares.items():
    print(f"{second:3d} s: {np.mean(values):6.2%} of the pixels are edges")
