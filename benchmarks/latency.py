"""Latency of the edges of a frame, at 30 frames per second.

    python benchmarks/latency.py [VIDEO ...]

The time from the source's letting a frame go to its edges, beside the sum of the nodes' own times.
"""

import argparse
import tempfile
from pathlib import Path

from throughput import SETTINGS, SIZES, make_video

from ros_visualise.graph.pipelines import image_pipeline
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sources.playback import Playback


def measure(path: Path, seconds: float) -> dict[str, dict[str, float]]:
    """The run report's figures of the nodes."""
    graph = image_pipeline("streamer", path=str(path)).configured(SETTINGS)
    runtime = LocalRuntime(graph, Playback(loop=True, duration_s=seconds))
    runtime.start()
    while not runtime.wait(60):
        pass
    runtime.stop()
    return runtime.report().nodes


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("videos", nargs="*", type=Path)
    parser.add_argument("--seconds", type=float, default=10)
    args = parser.parse_args()
    print("| video | source to edges p50 ms | p99 ms | sum of the nodes ms | ratio | dropped |")
    print("|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        videos = {path.name: path for path in args.videos} or {
            title: make_video(Path(folder) / f"{title}.mp4", size) for title, size in SIZES.items()
        }
        for title, path in videos.items():
            nodes = measure(path, args.seconds)
            own = sum(node.step_ms or 0 for node in nodes.values())
            edges = nodes["edge_detector"]
            dropped = sum(sum(node.dropped.values()) for node in nodes.values())
            print(
                f"| {title} | {edges.p50_ms:.2f} | {edges.p99_ms:.2f} | {own:.2f} "
                f"| {edges.p50_ms / own:.2f} | {dropped} |"
            )


if __name__ == "__main__":
    main()
