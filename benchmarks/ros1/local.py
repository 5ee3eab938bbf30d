"""The pipeline in the local runtime, with no ROS: what the ROS graph is held against.

    python local.py VIDEO --seconds S --warmup W

Prints one JSON object.
"""

import argparse
import json
import time

from ros_visualise.graph.pipelines import image_pipeline
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sources.playback import Playback


def measure(path: str, warmup_s: float, seconds: float) -> dict[str, float]:
    """Frames per second and processor time of each, at rate 0."""
    graph = image_pipeline("streamer", path=path).configured({"fps_control": {"enabled": False}})
    runtime = LocalRuntime(graph, Playback(rate=0, loop=True))
    runtime.start()

    def state() -> tuple[float, float, float]:
        edges = runtime.report().topics["/edges"]
        return edges.messages, time.monotonic(), time.process_time()

    while not state()[0]:
        time.sleep(0.01)
    time.sleep(warmup_s)
    before = state()
    time.sleep(seconds)
    count, wall_s, cpu_s = (b - a for a, b in zip(before, state(), strict=True))
    runtime.stop()
    return {"fps": count / wall_s, "cpu_ms": cpu_s / count * 1e3}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("video")
    parser.add_argument("--seconds", type=float, required=True)
    parser.add_argument("--warmup", type=float, required=True)
    args = parser.parse_args()
    print(json.dumps(measure(args.video, args.warmup, args.seconds)))


if __name__ == "__main__":
    main()
