"""Memory of a long run: peak and growth of the resident set, from start to end.

python benchmarks/memory.py [--frames 10000] [VIDEO]
"""

import argparse
import resource
import tempfile
import time
from pathlib import Path

from throughput import SETTINGS, SIZES, make_video

from ros_visualise.graph.pipelines import image_pipeline
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sources.playback import Playback


def resident_mib() -> float:
    """The resident set now."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 2**20


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("video", nargs="?", type=Path)
    parser.add_argument("--frames", type=int, default=10_000)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        path = args.video or make_video(Path(folder) / "4K.mp4", SIZES["4K"])
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**10
        graph = image_pipeline("streamer", path=str(path)).configured(SETTINGS)
        playback = Playback(rate=0, loop=True, frames=args.frames)
        runtime = LocalRuntime(graph, playback)
        runtime.start()
        samples = []
        while not runtime.wait(0.5):
            samples.append(resident_mib())
            time.sleep(0)
        runtime.stop()
    tenth = max(len(samples) // 10, 1)
    early, late = samples[tenth : 2 * tenth], samples[-tenth:]
    print(f"peak {max(samples):.0f} MiB over {args.frames} frames (before: {before:.0f} MiB)")
    print(f"mean of the second tenth {sum(early) / len(early):.0f} MiB, of the last", end=" ")
    print(f"{sum(late) / len(late):.0f} MiB")


if __name__ == "__main__":
    main()
