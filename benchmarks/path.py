"""Cost of a growing path: python benchmarks/path.py [--messages N] [--plot FILE.svg]

Odometry at 100 Hz, 5 m/s, so that every pose is far enough to be kept. *append and publish* sends
all poses with each one, as the seed's path.py does; *append, 5 Hz* sends them five times a second;
*path* is the node with its own settings. Bytes are those of nav_msgs/Path on a ROS 1 graph, CPU is
that of the step and of making and serialising what it publishes; no transport takes part.
"""

import argparse
import math
import resource
import time
from pathlib import Path as File
from typing import NamedTuple

import numpy as np
from memory import resident_mib

from ros_visualise.data import Header, Odometry, Path
from ros_visualise.messages import to_message
from ros_visualise.messages.definitions import Definitions
from ros_visualise.nodes.path import PathNode, PathParams
from ros_visualise.plotting.figure import Figure

HZ = 100
STARTED_NS = 1_700_000_000_000_000_000
CHECKPOINTS = (1_000, 6_000, 10_000, 30_000, 100_000, 300_000, 1_000_000)
MOST_APPENDED = 100_000  # poses; more of them take longer than anybody waits
WINDOW = 400  # messages before a checkpoint in which all is measured
DEFINITIONS = Definitions("ros1")
COLORS = {
    "append and publish": (200, 50, 40),
    "append, 5 Hz": (222, 145, 30),
    "path": (31, 111, 178),
}


class Cost(NamedTuple):
    """What one way takes after so many messages; ``resident_mib`` is the process's memory."""

    way: str
    messages: int
    poses: int
    bytes_per_s: float
    cpu_ms: float
    resident_mib: float


def serialise(path: Path) -> int:
    """Bytes of it on a ROS 1 graph."""
    message = to_message(path, DEFINITIONS.types)
    return len(DEFINITIONS.write(Path.type_name, message))


def drive(count: int):
    """Odometry of a car that turns slowly this way and that."""
    turns = np.random.default_rng(0).normal(0, 0.01, count)
    x = y = heading = 0.0
    for number, turn in enumerate(turns.tolist()):
        heading += turn
        x, y = x + 0.0501 * math.cos(heading), y + 0.0501 * math.sin(heading)
        quat = np.array([0, 0, math.sin(heading / 2), math.cos(heading / 2)])
        stamp_ns = STARTED_NS + number * 1_000_000_000 // HZ
        yield Odometry(np.array([x, y, 0.0]), quat, header=Header(stamp_ns, "odom"))


def appended(messages: int) -> list[Cost]:
    """The two ways that keep and send every pose."""
    poses = np.random.default_rng(0).normal(size=(messages, 7))
    path = Path(np.arange(messages), poses[:, :3], poses[:, 3:], Header(0, "odom"))
    message = to_message(path, DEFINITIONS.types)  # it grows by one pose a message: made before
    started = time.process_time()
    size = len(DEFINITIONS.write(Path.type_name, message))
    cpu_ms = (time.process_time() - started) * 1e3
    resident = resident_mib()
    return [
        Cost("append and publish", messages, messages, HZ * size, cpu_ms, resident),
        Cost("append, 5 Hz", messages, messages, 5 * size, cpu_ms * 5 / HZ, resident),
    ]


def bounded(messages: int) -> list[Cost]:
    """The node, at each checkpoint on its way."""
    params = PathParams()
    node = PathNode(params)
    costs = []
    goals = [goal for goal in CHECKPOINTS if goal <= messages]
    published, started = 0, 0.0
    for count, odometry in enumerate(drive(messages), 1):
        if goals and count == goals[0] - WINDOW + 1:
            published, started = 0, time.process_time()
        path = node.step(params, odom=odometry)
        if path is not None and goals and count > goals[0] - WINDOW:
            published += serialise(path)
        if goals and count == goals[0]:
            cpu_ms = (time.process_time() - started) * 1e3 / WINDOW
            rate = published * HZ / WINDOW
            poses = node.report()["poses"]
            costs.append(Cost("path", count, poses, rate, cpu_ms, resident_mib()))
            goals.pop(0)
    print(f"after {messages}: {node.report()}")
    return costs


def plot(costs: list[Cost]) -> Figure:
    """Bytes a second and CPU a message over the number of messages, all in powers of ten."""
    figure = Figure(880, 400)
    panels = (
        (60, "bytes per second", "bytes_per_s", (4, 10), ("10 KB", "1 MB", "100 MB", "10 GB")),
        (500, "CPU per message", "cpu_ms", (-2, 4), ("0.01 ms", "1 ms", "100 ms", "10 s")),
    )
    for left, title, field, (low, high), names in panels:
        places = {"left": left, "top": 60, "width": 340, "height": 270}
        draw_panel(figure, costs, title, field, low, high, names, **places)
    for number, (way, color) in enumerate(COLORS.items()):
        figure.line(np.array([[60 + 200 * number, 20], [84 + 200 * number, 20]]), color, 2.5)
        figure.text(90 + 200 * number, 24, way)
    return figure


def draw_panel(figure, costs, title, field, low, high, names, left, top, width, height):
    """One of the two."""

    def place(messages: float, value: float) -> tuple[float, float]:
        across = (math.log10(messages) - 3) / 3
        up = (math.log10(value) - low) / (high - low)
        return left + across * width, top + (1 - up) * height

    figure.text(left, top - 10, title)
    for power, name in zip(range(3, 7), ("1,000", "10,000", "100,000", "1,000,000"), strict=True):
        x = place(10.0**power, 10.0**low)[0]
        figure.line(np.array([[x, top], [x, top + height]]), (225, 225, 225))
        figure.text(x, top + height + 18, name, 11, "middle")
    for power, name in zip(range(low, high + 1, 2), names, strict=True):
        y = place(1000, 10.0**power)[1]
        figure.line(np.array([[left, y], [left + width, y]]), (225, 225, 225))
        figure.text(left - 6, y + 4, name, 11, "end")
    figure.text(left + width, top + height + 38, "messages of odometry", 11, "end")
    for way, color in COLORS.items():
        points = [place(one.messages, getattr(one, field)) for one in costs if one.way == way]
        figure.line(np.array(points), color, 2.5)
        for x, y in points:
            figure.dot(x, y, 3.5, color)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--messages", type=int, default=1_000_000)
    parser.add_argument("--plot", type=File)
    args = parser.parse_args()
    costs = bounded(args.messages)
    for messages in CHECKPOINTS:
        if messages <= min(args.messages, MOST_APPENDED):
            costs += appended(messages)
    print("| messages | way | poses | KB/s | CPU ms per message | resident MiB |")
    print("|---|---|---|---|---|---|")
    for one in sorted(costs, key=lambda one: (one.messages, one.way)):
        rate = f"{one.bytes_per_s / 1e3:,.0f}"
        figures = f"{rate} | {one.cpu_ms:.3f} | {one.resident_mib:.0f}"
        print(f"| {one.messages:,} | {one.way} | {one.poses:,} | {figures} |")
    print(f"peak {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**10:.0f} MiB")
    if args.plot is not None:
        args.plot.write_bytes(plot(costs).svg())


if __name__ == "__main__":
    main()
