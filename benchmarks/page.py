"""Cost of a page for the pipeline, with a client and with a browser that also draws it.

    python benchmarks/page.py [--chromium] [VIDEO]

The pipeline goes as fast as it can through a 4K video, in turn with nobody looking and with a
client that takes all that the page sends and draws nothing. With --chromium also with a headless
browser that draws in software, which takes processor time of its own.
"""

import argparse
import json
import shutil
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

from throughput import SIZES, make_video
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

SETTINGS = ["fps_control.enabled=false", "filters.threshold_mode=off"]
PORT = 8099
TOPICS = ("/controlled_stream", "/processed_image", "/edges")


def receive(received: list[int]) -> None:
    """Take images until the page ends, as panels do: bytes and images are counted."""
    with connect(f"ws://127.0.0.1:{PORT}/live/images", max_size=None) as live:
        views = {topic: {"topic": topic, "size": 720, "boxes": True} for topic in TOPICS}
        live.send(json.dumps({"show": views}))
        try:
            for image in live:
                received[0] += len(image)
                if isinstance(image, bytes):
                    received[1] += 1
                    length = int.from_bytes(image[:4], "little")
                    live.send(json.dumps({"got": json.loads(image[4 : 4 + length])["key"]}))
        except ConnectionClosed:
            return


def run(path: Path, frames: int, looks: str) -> tuple[float, float]:
    """(Frames per second, MB received)."""
    command = [sys.executable, "-m", "ros_visualise", "video", str(path), "--rate", "0", "--loop"]
    command += ["--frames", str(frames), "--json", "--port", str(PORT), "--no-token"]
    for setting in SETTINGS:
        command += ["--set", setting]
    pipeline = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    received = [0, 0]
    browser = None
    if looks == "receiving":
        threading.Thread(target=keep_trying, args=(received,), daemon=True).start()
    elif looks == "chromium":
        time.sleep(1)
        browser = draw()
    report = json.loads(pipeline.communicate()[0])
    if browser is not None:
        browser.terminate()
        browser.wait()
    return report["topics"]["/edges"]["wall_hz"], received[0] / 1e6


def keep_trying(received: list[int]) -> None:
    """Connect as soon as the page is there."""
    while not received[0]:
        try:
            receive(received)
        except OSError:
            time.sleep(0.1)


def draw() -> subprocess.Popen[bytes]:
    """A headless browser that shows the page."""
    profile = tempfile.mkdtemp()
    flags = ["--headless", "--no-sandbox", "--no-first-run", "--disable-background-networking"]
    flags += ["--disable-component-update", "--disable-sync", f"--user-data-dir={profile}"]
    flags += ["--remote-debugging-port=0", "--window-size=1500,950"]
    command = [shutil.which("chromium") or "chromium", *flags, f"http://127.0.0.1:{PORT}"]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("video", nargs="?", type=Path)
    parser.add_argument("--frames", type=int, default=300)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--chromium", action="store_true")
    args = parser.parse_args()
    kinds = ["nobody", "receiving", *(["chromium"] if args.chromium else [])]
    with tempfile.TemporaryDirectory() as folder:
        path = args.video or make_video(Path(folder) / "4K.mp4", SIZES["4K"])
        rounds = [{k: run(path, args.frames, k) for k in kinds} for _ in range(args.rounds)]
    print("| who looks | fps | of nobody | MB received |\n|---|---|---|---|")
    for kind in kinds:
        fps = statistics.median(one[kind][0] for one in rounds)
        share = statistics.median(one[kind][0] / one["nobody"][0] for one in rounds)
        received = statistics.median(one[kind][1] for one in rounds)
        print(f"| {kind} | {fps:.1f} | {share:.2f} | {received:.0f} |")


if __name__ == "__main__":
    main()
