"""Processor time of a page that shows many topics: `python benchmarks/topics.py`.

A recording of 500 topics with six messages a second each is played; in turn without a page, with a
page that nobody looks at, and with Chromium and some panels open. Processor time is in shares of a
core, of the program and of all processes of Chromium, which draws in software.
"""

import argparse
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
from playwright.sync_api import sync_playwright

from ros_visualise.data import Header, Odometry
from ros_visualise.messages.recorded import TopicType
from ros_visualise.sinks import open_recorder

TOPICS, HZ, LENGTH_S, MEASURED_S, SETTLED_S = 500, 6, 60, 8.0, 6.0
PORT = 8094
_TICKS = os.sysconf("SC_CLK_TCK")
PANELS = {
    "log, which is silent": {"panel": "log"},
    "topics": {"panel": "topics"},
    "topics, messages": {
        "row": [{"panel": "topics"}, {"panel": "messages", "state": {"topic": "/robot/topic_007"}}]
    },
    "topics, plot of 8 fields": {
        "row": [
            {"panel": "topics"},
            {
                "panel": "plots",
                "state": {
                    "curves": [f"/robot/topic_{n:03}:pose.pose.position.x" for n in range(8)]
                },
            },
        ]
    },
}


def record(path: Path) -> None:
    """Write the recording."""
    kind = TopicType(Odometry.type_name)
    names = [f"/robot/topic_{number:03}" for number in range(TOPICS)]
    zeros = np.zeros((6, 6))
    with open_recorder(str(path), dict.fromkeys(names, kind)) as recorder:
        for number in range(TOPICS * HZ * LENGTH_S):
            stamp_ns = 10**18 + number * 1_000_000_000 // (TOPICS * HZ)
            place = np.array([np.sin(number / 9000), 0.0, 0.0])
            still, level = np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0])
            header = Header(stamp_ns, "odom")
            message = Odometry(place, level, still, still, zeros, zeros, "base", header)
            recorder.write(names[number % TOPICS], message, stamp_ns)


def spent_s(processes: list[int]) -> float:
    """Processor time of processes so far, seconds."""
    total = 0
    for process in processes:
        try:
            fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
        except OSError:
            continue
        total += int(fields[11]) + int(fields[12])
    return total / _TICKS


def below(process: int) -> list[int]:
    """A process and all that it has started."""
    found = [process]
    for status in Path("/proc").glob("[0-9]*/stat"):
        try:
            parent = int(status.read_text().rpartition(")")[2].split()[1])
        except OSError:
            continue
        if parent == process:
            found += below(int(status.parent.name))
    return found


def measure(path: Path, view: str, layout: Any) -> tuple[float, float]:
    """Shares of a core: of the program, and of Chromium."""
    command = [sys.executable, "-m", "ros_visualise", "bag", str(path), "--view", view, "--loop"]
    if view == "web":
        command += ["--port", str(PORT), "--no-token"]
    program = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    try:
        if layout is None:
            time.sleep(SETTLED_S)
            return share([program.pid]), 0.0
        assert program.stderr is not None
        address = re.findall(r"http://\S+", program.stderr.readline().decode())[0]
        with sync_playwright() as playwright:
            found = shutil.which("chromium") or shutil.which("chromium-browser")
            browser = playwright.chromium.launch(
                executable_path=found, args=["--no-sandbox", "--disable-gpu"]
            )
            text = json.dumps(layout).translate(str.maketrans('"~', '~"'))
            browser.new_page().goto(f"{address}/?layout={quote(text)}")
            time.sleep(SETTLED_S)
            drawing = [one for one in below(os.getpid()) if one not in below(program.pid)]
            shares = share_of_both([program.pid], [one for one in drawing if one != os.getpid()])
            browser.close()
            return shares
    finally:
        program.send_signal(signal.SIGINT)
        program.wait(20)


def share(processes: list[int]) -> float:
    """Share of a core over some seconds."""
    return share_of_both(processes, [])[0]


def share_of_both(one: list[int], other: list[int]) -> tuple[float, float]:
    """The same of two groups of processes at once."""
    before = spent_s(one), spent_s(other)
    begin_s = time.monotonic()
    time.sleep(MEASURED_S)
    length_s = time.monotonic() - begin_s
    return (spent_s(one) - before[0]) / length_s, (spent_s(other) - before[1]) / length_s


def main() -> None:
    """Measure, and print the table."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "many.mcap"
        record(path)
        runs: list[tuple[str, str, Any]] = [("no page", "none", None), ("nobody", "web", None)]
        runs += [(name, "web", layout) for name, layout in PANELS.items()]
        print("| who looks | program, % of a core | Chromium, % of a core |\n|---|---|---|")
        for name, view, layout in runs:
            program, drawing = measure(path, view, layout)
            print(f"| {name} | {100 * program:.1f} | {100 * drawing:.1f} |", flush=True)


if __name__ == "__main__":
    main()
