"""Times that a person waits for on the page, in Chromium with software rendering.

    python benchmarks/browser.py [480p 1080p 4K]

A video with three images on the page: until the first and all of them are there; from a seek to the
first image, which may be a preview, and to the three images of that time; from a parameter to its
image (median, 95th percentile and longest of twenty); and images per second over all three while a
video at 30 frames per second plays. Also the MB that a browser loads.
"""

import argparse
import shutil
import statistics
import tempfile
import time
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any

from playwright.sync_api import sync_playwright
from throughput import SIZES, make_video

from ros_visualise.graph.pipelines import image_pipeline
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sources.playback import Playback
from ros_visualise.ui import ViewOptions
from ros_visualise.ui.page import Page

PORT = 8098
ROUNDS, PLAY_S = 20, 8.0
FLAGS = ["--no-sandbox", "--disable-gpu", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
READY = "document.querySelectorAll('[data-images]').length >= 3"
FIRST = "document.querySelector('[data-images]')"
COUNT = """() => {
    window.drawn = [];
    const now = () => (performance.timeOrigin + performance.now()) / 1000;
    const topic = (panel) => panel.querySelector("[role=img]").getAttribute("aria-label");
    const note = ({ target }) => drawn.push([now(), topic(target), target.dataset.preview]);
    new MutationObserver((all) => all.forEach(note)).observe(document.body,
        { attributes: true, subtree: true, attributeFilter: ["data-images"] });
}"""
TOPICS = ("/controlled_stream", "/processed_image", "/edges")


class Waits:
    """Seconds from each change until images were drawn: the first one, and those of all topics."""

    def __init__(self, frame: Any, topics: Collection[str], change: Callable[[int], None]) -> None:
        self.first: list[float] = []
        self.all: list[float] = []
        for number in range(ROUNDS):
            frame.evaluate("drawn.length = 0")
            begin_s = time.time()
            change(number)
            while not topics <= (found := self._exact(frame)).keys():
                frame.page.wait_for_timeout(20)
                assert time.time() < begin_s + 60
            self.first.append(min(at_s for at_s, *_ in frame.evaluate("drawn")) - begin_s)
            self.all.append(max(found[topic] for topic in topics) - begin_s)
            frame.page.wait_for_timeout(300)

    def _exact(self, frame: Any) -> dict[str, float]:
        """Topic -> when its image was drawn first."""
        drawn = reversed(frame.evaluate("drawn"))
        return {topic: at_s for at_s, topic, preview in drawn if preview == "false"}


def shown(found: list[float]) -> str:
    p95 = statistics.quantiles(found, n=20)[-1]
    return f"{statistics.median(found):.3f}, {p95:.3f}, {max(found):.3f}"


def measure(tab: Any, page: Page, runtime: LocalRuntime, playback: Playback) -> list[str]:
    loaded = [0.0]
    session = tab.context.new_cdp_session(tab)
    session.send("Network.enable")
    session.on("Network.loadingFinished", lambda e: loaded.append(e["encodedDataLength"] / 1e6))
    begin_s = time.time()
    tab.goto(page.url)
    frame = tab.main_frame
    frame.wait_for_function(FIRST, timeout=120_000)
    first_s = time.time() - begin_s
    frame.wait_for_function(READY, timeout=120_000)
    all_s = time.time() - begin_s
    tab.wait_for_timeout(2000)
    frame.evaluate(COUNT)
    seeks = Waits(frame, {*TOPICS}, lambda n: playback.seek(0.2 + 0.37 * n % 1.6))
    filters = runtime.parameters["filters"]
    changes = Waits(frame, {TOPICS[1]}, lambda n: filters.update({"threshold": 50 + 5 * n}))
    playback.play()
    tab.wait_for_timeout(2000)
    before, begin_s = frame.evaluate("drawn.length"), time.time()
    tab.wait_for_timeout(1000 * PLAY_S)
    rate = (frame.evaluate("drawn.length") - before) / (time.time() - begin_s)
    return [
        f"{first_s:.2f}, {all_s:.2f}",
        shown(seeks.first),
        shown(seeks.all),
        shown(changes.all),
        f"{rate:.0f}",
        f"{sum(loaded):.1f}",
    ]


def run(path: Path) -> list[str]:
    playback = Playback(hold=True, loop=True)
    playback.pause()
    page = Page(ViewOptions(port=PORT))
    runtime = LocalRuntime(image_pipeline("streamer", path=str(path)), playback)
    runtime.start()
    page.open(runtime)
    with sync_playwright() as started:
        chromium = shutil.which("chromium") or "chromium"
        browser = started.chromium.launch(executable_path=chromium, args=FLAGS)
        found = measure(browser.new_page(), page, runtime, playback)
        browser.close()
    page.close()
    runtime.stop()
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("sizes", nargs="*", default=["480p", "1080p", "4K"])
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        rows = {n: run(make_video(Path(folder) / f"{n}.mp4", SIZES[n])) for n in args.sizes}
    print("| video | first, all images s | seek: first s | seek: all s | parameter s | Hz | MB |")
    print("|" + "---|" * 7)
    for name, cells in rows.items():
        print(f"| {name} | {' | '.join(cells)} |")


if __name__ == "__main__":
    main()
