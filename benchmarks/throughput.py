"""Throughput of the image pipeline, compared with what it is made of and a plain loop.

    python benchmarks/throughput.py [VIDEO ...]

Without files it makes three (480p, 1080p, 4K; H.264). Every figure is taken in a process of its
own, in turn, several rounds over; the table shows medians in frames per second.

- decode: the source alone, nobody looks at the pixels
- canny: gray and Canny on images that are in memory already
- loop: VideoCapture.read -> cvtColor -> Canny, one after the other
- bound: 1 / max(slowest stage, CPU time per frame / cores), stages run one at a time
- pipeline: streamer -> fps_control (off) -> filters (gray alone) -> edge_detector
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import av
import cv2

from ros_visualise.graph.pipelines import image_pipeline
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sources.flyover import Flyover
from ros_visualise.sources.playback import Playback
from ros_visualise.sources.video import Video

SIZES = {"480p": (854, 480), "1080p": (1920, 1080), "4K": (3840, 2160)}
LOW, HIGH = 200, 300
SETTINGS = {
    "fps_control": {"enabled": False},
    "filters": {"gray": True, "threshold_mode": "off"},
    "edge_detector": {"low": LOW, "high": HIGH},
}


def decode(path: Path, frames: int) -> dict[str, float]:
    return timed(1 for _ in looped(path, frames))


def canny(path: Path, frames: int) -> dict[str, float]:
    images = [image.pixels for _, image in zip(range(5), looped(path, 5), strict=True)]
    bgr = [images[number % len(images)] for number in range(frames)]
    return timed(cv2.Canny(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), LOW, HIGH) for image in bgr)


def loop(path: Path, frames: int) -> dict[str, float]:
    def work():
        done = 0
        while done < frames:
            capture = cv2.VideoCapture(str(path))
            while done < frames:
                there, image = capture.read()
                if not there:
                    break
                done += 1
                yield cv2.Canny(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), LOW, HIGH)

    return timed(work())


def stages(path: Path, frames: int) -> dict[str, float]:
    """The stages of the pipeline, each alone on the same frames: decode, pixels, gray, edges."""
    graph = image_pipeline("streamer", path=str(path)).configured(SETTINGS)
    filters, edges = graph.node("filters"), graph.node("edge_detector")
    gray, canny = filters.type.make(filters.params), edges.type.make(edges.params)
    walls, cpu = dict.fromkeys(("decode", "gray", "edges"), 0.0), 0.0
    images = iter(looped(path, frames))
    for _ in range(frames):
        start, cpu_start = time.perf_counter(), time.process_time()
        image = next(images)
        decoded = time.perf_counter()
        processed = gray.step(image=image, params=filters.params)
        grayed = time.perf_counter()
        canny.step(image=processed, params=edges.params)
        walls["decode"] += decoded - start
        walls["gray"] += grayed - decoded
        walls["edges"] += time.perf_counter() - grayed
        cpu += time.process_time() - cpu_start
    per_frame = max(max(walls.values()), cpu / os.cpu_count()) / frames
    shares = {f"{name}_ms": wall / frames * 1e3 for name, wall in walls.items()}
    return {"fps": 1 / per_frame, "cpu_ms": cpu / frames * 1e3, **shares}


def pipeline(path: Path, frames: int) -> dict[str, float]:
    graph = image_pipeline("streamer", path=str(path)).configured(SETTINGS)
    runtime = LocalRuntime(graph, Playback(rate=0, loop=True, frames=frames))
    start, cpu_start = time.perf_counter(), time.process_time()
    runtime.start()
    while not runtime.wait(60):
        pass
    wall = time.perf_counter() - start
    cpu = time.process_time() - cpu_start
    runtime.stop()
    assert runtime.report().topics["/edges"].messages == frames
    return {"fps": frames / wall, "cpu_ms": cpu / frames * 1e3}


FIGURES = {f.__name__: f for f in (decode, canny, loop, stages, pipeline)}


def looped(path: Path, frames: int):
    """The frames of a video, over and over."""
    done = 0
    while True:
        for _, image in Video(path).read():
            if done == frames:
                return
            done += 1
            yield image


def timed(work) -> dict[str, float]:
    start, cpu_start = time.perf_counter(), time.process_time()
    frames = sum(1 for _ in work)
    wall, cpu = time.perf_counter() - start, time.process_time() - cpu_start
    return {"fps": frames / wall, "cpu_ms": cpu / frames * 1e3}


def make_video(path: Path, size: tuple[int, int], frames: int = 60) -> Path:
    """Film the demo's scene."""
    scene = Flyover(size)
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=30, options={"preset": "fast", "crf": "20"})
        stream.width, stream.height, stream.pix_fmt = *size, "yuv420p"
        for _, (_, image) in zip(range(frames), scene.read(0), strict=False):
            container.mux(stream.encode(av.VideoFrame.from_ndarray(image.pixels, "bgr24")))
        container.mux(stream.encode())
    return path


def measure(name: str, path: Path, frames: int) -> dict[str, float]:
    command = [sys.executable, __file__, "--figure", name, "--frames", str(frames), str(path)]
    return json.loads(subprocess.run(command, capture_output=True, check=True).stdout)


def table(videos: dict[str, Path], rounds: int, seconds: float) -> None:
    print("| video | decode | canny | loop | bound | pipeline | of bound | of loop | CPU ms |")
    print("|---|---|---|---|---|---|---|---|---|")
    for title, path in videos.items():
        frames = max(30, int(measure("loop", path, 30)["fps"] * seconds))
        results = [{name: measure(name, path, frames) for name in FIGURES} for _ in range(rounds)]
        fps = {name: statistics.median(r[name]["fps"] for r in results) for name in FIGURES}
        of = {
            name: statistics.median(r["pipeline"]["fps"] / r[name]["fps"] for r in results)
            for name in ("stages", "loop")
        }
        cpu = statistics.median(r["pipeline"]["cpu_ms"] for r in results)
        order = ("decode", "canny", "loop", "stages", "pipeline")
        cells = [f"{fps[name]:.1f}" for name in order]
        cells += [f"{of['stages']:.2f}", f"{of['loop']:.2f}", f"{cpu:.2f}"]
        print(f"| {title} | " + " | ".join(cells) + " |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("videos", nargs="*", type=Path)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=5, help="that the plain loop runs")
    parser.add_argument("--figure", choices=FIGURES, help=argparse.SUPPRESS)
    parser.add_argument("--frames", type=int, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.figure:
        print(json.dumps(FIGURES[args.figure](args.videos[0], args.frames)))
        return
    with tempfile.TemporaryDirectory() as folder:
        videos = {path.name: path for path in args.videos} or {
            title: make_video(Path(folder) / f"{title}.mp4", size) for title, size in SIZES.items()
        }
        table(videos, args.rounds, args.seconds)


if __name__ == "__main__":
    main()
