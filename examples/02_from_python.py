"""The pipeline from Python: how much of each second of a video is edges?

python examples/02_from_python.py FILE
"""

import sys
from collections import defaultdict

import numpy as np

from ros_visualise.data import Image
from ros_visualise.graph.pipelines import image_pipeline
from ros_visualise.nodes import node
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sources.playback import Playback

shares = defaultdict(list)


@node("measure", inputs={"edges": Image}, outputs={"edges": Image})
def measure(edges: Image, params: object) -> Image:
    """Notes the share of edge pixels."""
    shares[edges.header.stamp_ns // 10**9].append(
        np.count_nonzero(edges.pixels) / edges.pixels.size
    )
    return edges


graph = image_pipeline("streamer", path=sys.argv[1]).insert(measure.declared, after="edge_detector")
graph = graph.configured({"edge_detector": {"low": 50, "high": 150}, "fps_control": {"fps": 5}})
runtime = LocalRuntime(graph, Playback(rate=0))
runtime.start()
while not runtime.wait(timeout_s=1):
    pass
runtime.stop()
for second, values in shares.items():
    print(f"{second:3d} s: {np.mean(values):6.2%} of the pixels are edges")
