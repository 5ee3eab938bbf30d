"""Delay of a recording's messages: `python benchmarks/playback.py RECORDING`.

It is played at its own speed, with all nodes, while nobody looks, while a client takes all that the
page sends and, with --chromium, while a headless browser draws it in software. Late is how long
after its time, counted from the first, a message reaches who listens to it.
"""

import argparse
import threading
import time
from collections import defaultdict
from pathlib import Path

import numpy as np
import page

from ros_visualise.graph.pipelines import recording_pipeline
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.runtime.queues import Packet
from ros_visualise.sources.opening import open_recording
from ros_visualise.sources.playback import Playback
from ros_visualise.ui import ViewOptions, open_view

_SPIN_S = 0.05


class Arrivals:
    """Listens to a topic, and keeps when its messages came."""

    def __init__(self) -> None:
        self.times_ns: list[int] = []

    def put(self, packet: Packet) -> None:
        """Take a message."""
        if packet.message is not None:
            self.times_ns.append(time.monotonic_ns())

    def close(self) -> None:
        """Nothing more comes."""


def play(path: Path, duration_s: float, looks: str) -> np.ndarray:
    """How late each message was, in seconds."""
    recording = open_recording(path)
    due_ns = recording.stamps_ns()
    graph = recording_pipeline(recording)
    runtime = LocalRuntime(graph, Playback(duration_s=duration_s))
    view = open_view(
        "none" if looks == "nobody" else "web", ViewOptions(port=page.PORT, token=False)
    )
    arrivals: dict[str, Arrivals] = defaultdict(Arrivals)
    for port, topic in graph.source.outputs.items():
        runtime.topic(topic).connect(arrivals[port])
    view.open(runtime)
    browser = page.draw() if looks == "chromium" else None
    if looks == "receiving":
        threading.Thread(target=page.keep_trying, args=([0],), daemon=True).start()
    if browser is not None:
        time.sleep(20)
    runtime.start()
    while not runtime.wait(0):
        view.spin(_SPIN_S)
    view.close()
    runtime.stop()
    if browser is not None:
        browser.terminate()
        browser.wait()
    late = [
        (time_ns, due)
        for port, one in arrivals.items()
        for time_ns, due in zip(one.times_ns, due_ns[port], strict=False)
    ]
    times, due = np.array(sorted(late)).T
    return ((times - times[0]) - (due - due[0])) / 1e9


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("recording", type=Path)
    parser.add_argument("--duration", type=float, default=20)
    parser.add_argument("--chromium", action="store_true")
    args = parser.parse_args()
    kinds = ["nobody", "receiving", *(["chromium"] if args.chromium else [])]
    print("| who looks | messages | late, median ms | 95% | most |\n|---|---|---|---|---|")
    for kind in kinds:
        late_ms = 1e3 * np.abs(play(args.recording, args.duration, kind))
        median, most = np.median(late_ms), late_ms.max()
        high = np.percentile(late_ms, 95)
        print(f"| {kind} | {len(late_ms)} | {median:.2f} | {high:.2f} | {most:.1f} |")


if __name__ == "__main__":
    main()
