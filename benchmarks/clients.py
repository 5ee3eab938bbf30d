"""Cost of several clients of a page, and time until a large recording is shown.

    python benchmarks/clients.py [--gigabytes 5]

Three topics of a 1080p video at 30 frames per second. Processor time of the program with none, one
and four clients that take every image and draw nothing: as an image is encoded once for all, the
difference between one and four is what sending costs. Then three Chromium windows with software
rendering, each with the three images: images per second of each. Then a recording of that size,
an MCAP file and a bag of ROS 1, from the start of the command until the first image has come.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np
import psutil
from browser import COUNT, FLAGS, READY
from page import PORT, receive
from playwright.sync_api import sync_playwright
from throughput import SIZES, make_video

from ros_visualise.data import Header, Image
from ros_visualise.messages.recorded import TopicType
from ros_visualise.sinks import open_recorder

SECONDS = 15.0


def started(path: Path, *options: str) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "ros_visualise", str(path), "--port", str(PORT), "--no-token"]
    return subprocess.Popen([*command, *options], stderr=subprocess.DEVNULL)


def cost(path: Path, clients: int) -> tuple[float, float]:
    """(Processor time in s per s, images per second and client)."""
    process = started(path, "--loop")
    received = [[0, 0] for _ in range(clients)]
    for one in received:
        threading.Thread(target=keep_taking, args=(one,), daemon=True).start()
    time.sleep(8)
    usage = psutil.Process(process.pid)
    before, begin_s = usage.cpu_times(), time.time()
    counted = sum(count for _, count in received)
    time.sleep(SECONDS)
    spent, wall_s = usage.cpu_times(), time.time() - begin_s
    images = sum(count for _, count in received) - counted
    process.terminate()
    process.wait()
    cpu_s = spent.user + spent.system - before.user - before.system
    return cpu_s / wall_s, images / wall_s / max(clients, 1)


def keep_taking(received: list[int]) -> None:
    """Take images as soon as the page is there, until it ends."""
    while not received[1]:
        try:
            receive(received)
        except OSError:
            time.sleep(0.1)


def windows(path: Path, number: int) -> list[float]:
    """Images per second over the three images of each of several windows."""
    process = started(path, "--loop")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path="/usr/bin/chromium", args=FLAGS)
        tabs = [browser.new_context().new_page() for _ in range(number)]
        for tab in tabs:
            open_page(tab)
            tab.wait_for_function(READY, timeout=120_000)
            tab.evaluate(COUNT)
        tabs[0].wait_for_timeout(3000)
        before, begin_s = [tab.evaluate("drawn.length") for tab in tabs], time.time()
        tabs[0].wait_for_timeout(1000 * SECONDS)
        rates = [
            (tab.evaluate("drawn.length") - count) / (time.time() - begin_s)
            for tab, count in zip(tabs, before, strict=True)
        ]
        browser.close()
    process.terminate()
    process.wait()
    return rates


def open_page(tab: object) -> None:
    """Open the page as soon as it is there."""
    while True:
        try:
            tab.goto(f"http://127.0.0.1:{PORT}")  # type: ignore[attr-defined]
            return
        except Exception:
            time.sleep(0.1)


def opening(path: Path) -> float:
    """Seconds from the start of the command to the first image, which a client has asked for."""
    begin_s = time.time()
    process = started(path)
    received = [0, 0]
    threading.Thread(target=keep_taking, args=(received,), daemon=True).start()
    while not received[1]:
        time.sleep(0.01)
    took_s = time.time() - begin_s
    process.terminate()
    process.wait()
    return took_s


def make_recording(path: Path, gigabytes: float) -> Path:
    """A recording of images of 1920x1080 that compress to nothing less."""
    pixels = np.random.default_rng(0).integers(0, 255, (1080, 1920, 3), np.uint8)
    with open_recorder(str(path), {"/image_raw": TopicType("sensor_msgs/msg/Image")}) as recorder:
        for number in range(round(gigabytes * 1e9 / pixels.nbytes)):
            stamp_ns = (number + 1) * 33_333_333
            recorder.write("/image_raw", Image(pixels, "bgr8", Header(stamp_ns)), stamp_ns)
    return path


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--gigabytes", type=float, default=5)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        video = make_video(Path(folder) / "1080p.mp4", SIZES["1080p"])
        print("| clients | CPU, % of a core | images/s of each |\n|---|---|---|")
        found = {number: cost(video, number) for number in (0, 1, 4)}
        for number, (cpu, rate) in found.items():
            print(f"| {number} | {100 * cpu:.0f} | {rate:.0f} |", flush=True)
        (one, one_hz), (four, four_hz) = found[1], found[4]
        each_ms = 1e3 * (four - one) / max(4 * four_hz - one_hz, 1)
        print(f"\nfor a further client: {each_ms:.2f} ms of CPU an image", flush=True)
        rates = windows(video, 3)
        print("three windows, images/s of each:", json.dumps([round(hz) for hz in rates]))
        for suffix in (".mcap", ".bag"):
            path = make_recording(Path(folder) / f"large{suffix}", args.gigabytes)
            times_s = [opening(path) for _ in range(3)]
            print(f"{path.stat().st_size / 1e9:.1f} GB {suffix}: {sorted(times_s)[1]:.2f} s")
            path.unlink()


if __name__ == "__main__":
    main()
