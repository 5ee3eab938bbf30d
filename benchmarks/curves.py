"""Time and memory of curves with many samples: `python benchmarks/curves.py [--chromium]`.

A walk of 5 million samples at a kilohertz, with uneven times and a gap, is stored; then views of it
are taken, from the whole to half a second. With --chromium a plot panel shows the same walk: from
the request for a view until it is drawn, and the part of that which ECharts takes; Chromium draws
in software.
"""

import argparse
import json
import shutil
import time
from typing import Any
from urllib.parse import quote

import numpy as np
from playwright.sync_api import sync_playwright

from ros_visualise.graph.pipelines import image_pipeline
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sources.playback import Playback
from ros_visualise.ui import ViewOptions
from ros_visualise.ui.live.curves import SampleStore
from ros_visualise.ui.live.plots import PlotHub
from ros_visualise.ui.page import Page

_PIECE = 50_000
_LENGTHS_S = (1.0, 0.9, 0.1, 0.002, 0.0001)
"""Parts of the whole that are viewed."""
PORT = 8093
HEAR = """
window.arrived = [];
window.WebSocket = class extends WebSocket {
  constructor(...all) {
    super(...all);
    if (!this.url.endsWith("/live/plots")) return;
    this.addEventListener("message", ({ data }) => {
      if (data instanceof ArrayBuffer) arrived.push(performance.now());
    });
  }
};
"""
WATCH = """async () => {
  const { PaneChart } = await import(rv.root + "/parts/plot_chart.js");
  const draw = PaneChart.prototype.draw;
  window.drawn = [];
  PaneChart.prototype.draw = function (...shown) {
    const begin = performance.now();
    draw.apply(this, shown);
    this.chart.getZr().flush();
    window.drawn.push([begin, performance.now()]);
  };
}"""
MOVE = """async (key) => {
  const next = async (times, from, of) => {
    for (;;) {
      const found = times.find((one) => of(one) > from);
      if (found) return found;
      await new Promise(requestAnimationFrame);
    }
  };
  const begin = performance.now();
  document.querySelector(".rv-chart").dispatchEvent(new KeyboardEvent("keydown", { key }));
  const came = await next(arrived, begin, (one) => one);
  const [start, end] = await next(drawn, came, ([one]) => one);
  return [end - begin, came - begin, end - start];
}"""


def fill(count: int) -> tuple[SampleStore, float]:
    """A store with so many samples, and the seconds that this took."""
    rng = np.random.default_rng(0)
    times_s = (np.arange(count) + rng.uniform(0, 0.9, count)) / 1000
    values = rng.normal(size=count).cumsum()
    values[count // 3 : count // 3 + 100] = np.nan
    store = SampleStore(["x"], 0.0)
    start_s = time.perf_counter()
    for first in range(0, count, _PIECE):
        piece = slice(first, first + _PIECE)
        store.add(times_s[piece], values[piece, None])
    return store, time.perf_counter() - start_s


def view_ms(store: SampleStore, start_s: float, end_s: float, columns: int) -> tuple[float, float]:
    """Median and longest time of 20 views, milliseconds."""
    times_ms = []
    for _ in range(20):
        start = time.perf_counter()
        store.between("x", start_s, end_s, columns)
        times_ms.append(1000 * (time.perf_counter() - start))
    return float(np.median(times_ms)), max(times_ms)


def main() -> None:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=int, default=5_000_000)
    parser.add_argument("--chromium", action="store_true")
    options = parser.parse_args()
    count = options.samples
    store, spent_s = fill(count)
    size = store.nbytes / 2**20
    print(f"{count} samples: stored in {spent_s:.2f} s, {size:.0f} MiB\n")
    print("| view, s | columns | median ms | longest ms |\n|---|---|---|---|")
    end_s = count / 1000
    middle_s = end_s / 2
    for length_s in (part * end_s for part in _LENGTHS_S):
        for columns in (750, 2000):
            span = middle_s - length_s / 2, middle_s + length_s / 2
            median_ms, longest_ms = view_ms(store, *span, columns)
            print(f"| {length_s:g} | {columns} | {median_ms:.1f} | {longest_ms:.1f} |")
    if options.chromium:
        print_drawn(store, end_s)


def print_drawn(store: SampleStore, end_s: float) -> None:
    """Measure in a browser, and print the table."""
    playback = Playback(hold=True)
    playback.pause()
    runtime = LocalRuntime(image_pipeline("landscape"), playback)
    runtime.start()
    page = Page(ViewOptions(port=PORT, token=False))
    page.open(runtime)
    hub: Any = page._server._hubs[PlotHub.path]
    store.share = 1.0
    hub._followed.curves._stores["/edges", "x"] = store
    print(
        "\n| view, s | until drawn, ms | until it has come, ms | ECharts, ms |\n|---|---|---|---|"
    )
    with sync_playwright() as playwright:
        found = shutil.which("chromium") or shutil.which("chromium-browser")
        browser = playwright.chromium.launch(
            executable_path=found, args=["--no-sandbox", "--disable-gpu"]
        )
        for length_s in (part * end_s for part in _LENGTHS_S):
            tab = browser.new_page(viewport={"width": 1500, "height": 800})
            tab.add_init_script(HEAR)
            window = [(end_s - length_s) / 2, (end_s + length_s) / 2]
            layout = {"panel": "plots", "state": {"curves": ["/edges:x"], "window": window}}
            text = json.dumps(layout).translate(str.maketrans('"~', '~"'))
            tab.goto(f"{page.url}/?layout={quote(text)}")
            tab.wait_for_selector(".rv-chart canvas")
            tab.wait_for_timeout(2000)
            tab.evaluate(WATCH)
            spent = []
            for number in range(20):
                spent.append(tab.evaluate(MOVE, ["PageUp", "PageDown"][number % 2]))
                tab.wait_for_timeout(100)
            cells = [f"{np.median(one):.0f}, {max(one):.0f}" for one in zip(*spent, strict=True)]
            print(f"| {length_s:g} | {' | '.join(cells)} |", flush=True)
            tab.close()
        browser.close()
    page.close()
    runtime.stop()


if __name__ == "__main__":
    main()
