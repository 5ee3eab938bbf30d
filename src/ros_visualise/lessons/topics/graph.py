"""Nodes, topics and messages, shown with the running graph."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from time import monotonic_ns, sleep

import numpy as np

from ros_visualise.core.params import param
from ros_visualise.data import Floats, Image, Message
from ros_visualise.lessons.lesson import GIVES, TAKES, WIDTH, Lesson, Step, show, work_of
from ros_visualise.nodes import node
from ros_visualise.plotting.axes import PlotAxes
from ros_visualise.plotting.colors import BLUE, GRAY, GREEN, INK, RED
from ros_visualise.plotting.diagrams import DiagramNode, GraphLayout
from ros_visualise.plotting.figure import Figure

_KEPT = 200
_ROW, _BOX, _CHARACTER = 54.0, 28.0, 9.0  # heights of rows and boxes, width of a letter


@node("message", inputs=TAKES, outputs=GIVES)
def message(image: Image, params: object) -> dict[str, Message]:
    """A message: data of a known type, with a time stamp and a frame."""
    pixels = work_of(image, np.ndarray)
    height, width = pixels.shape[:2]
    text = f"""
        Nodes send each other messages, each of a known type. This one is a sensor_msgs/Image:

            header.stamp     {image.header.stamp_ns // 10**9}.{image.header.stamp_ns % 10**9:09d}
            header.frame_id  {image.header.frame_id}
            height, width    {height}, {width}
            encoding         bgr8
            step             {3 * width}   bytes per row
            data             {pixels.nbytes} bytes

        The stamp is the time at which the camera took the image, not the time at which it arrived.
        Nodes that process the image keep its stamp, so that you can find results that belong
        together.
        """
    return show(image, pixels, text)


@dataclass(frozen=True, eq=False)
class _Counted:
    """Number of a message on its topic, from 1."""

    number: int


@node("rate", inputs=TAKES, outputs=GIVES)
class Rate:
    """The rate of a topic: how often a message arrives."""

    def __init__(self, _: object) -> None:
        self._number = 0
        self.reset()

    def reset(self) -> None:
        self._stamps: deque[int] = deque(maxlen=_KEPT)
        self._arrivals: deque[int] = deque(maxlen=_KEPT)

    def step(self, image: Image, params: object) -> dict[str, Message]:
        """Count a message, and report the rate of the latest ones."""
        self._number += 1
        self._stamps.append(image.header.stamp_ns)
        self._arrivals.append(monotonic_ns())
        by_stamp, by_clock = (
            np.diff(np.array(one)) / 1e6 for one in (self._stamps, self._arrivals)
        )
        text = f"""
            {self._number} messages have arrived on this topic. The rate of the last
            {len(self._stamps)}:

                by their stamps
                {_rate(by_stamp)}
                by this computer's clock
                {_rate(by_clock)}

            A topic has a name and a type. A publisher does not know who subscribes to it, and a
            subscriber does not know who publishes, so any node can be replaced by another. The
            figure shows the intervals between arrivals (red) and between stamps (blue).
            """
        return show(image, _draw_intervals(by_stamp, by_clock), text, _Counted(self._number))


@dataclass(frozen=True)
class SlowParams:
    """Processing time."""

    busy_ms: int = param(200, "processing time of each message, milliseconds", min=0, max=2000,
                         slider=(0, 500))  # fmt: skip


@node("slow", params=SlowParams, inputs=TAKES, outputs=GIVES)
class Slow:
    """A node that is too slow: messages are dropped."""

    def __init__(self, _: SlowParams) -> None:
        self._taken = self._first = 0

    def step(self, image: Image, params: SlowParams) -> dict[str, Message]:
        """Wait before answering."""
        number = work_of(image, _Counted).number
        self._first = self._first or number
        self._taken += 1
        sleep(params.busy_ms / 1000)
        came = number - self._first + 1
        most = f"{1000 / params.busy_ms:.1f} per second" if params.busy_ms else "all messages"
        text = f"""
            This node spends {params.busy_ms} ms on each message, so it can process {most}. While it
            works, each new message replaces the one that is waiting, so the node always gets the
            latest one. Of {came} messages it processed {self._taken}; {came - self._taken}
            ({100 * (came - self._taken) / came:.0f} %) were dropped.

            That is right for watching and steering, where only the newest message counts. A
            recording must not lose any: there the source waits for the slowest node. Drops are
            counted in the table of topics.
            """
        return show(image, _draw_share(self._taken, came), text)


@node("nodes", inputs=TAKES, outputs=GIVES)
def nodes(image: Image, params: object) -> dict[str, Message]:
    """The graph: nodes, and the topics between them."""
    text = """
        Each box is a node, which does one thing; the names between them are topics. Here all nodes
        are threads of one process, and messages are not copied. On a ROS graph the same nodes can
        be processes on several machines; rosrun ros_visualise viewer shows them in the browser.
        The main panel shows the whole graph that is running (graph), and the rates and drops of its
        topics (table of topics).
        """
    return show(image, _draw_graph(), text)


LESSON = Lesson(
    "graph",
    "nodes, topics and messages, publish and subscribe, rates and drops, on the running graph",
    """
    A robot's software is made of many small programs, called nodes, that send each other messages.
    Each image here is drawn by such a node, and shows the messages that the node receives: pictures
    of {width} x {height} pixels. Play, pause, change the rate, and watch them.
    """,
    [
        Step(message),
        Step(Rate, "picture"),
        Step(Slow, "rate"),
        Step(nodes, "picture"),
    ],
    plays=True,
    export_s=3.0,
    in_time=True,
)


def _rate(intervals_ms: Floats) -> str:
    if not len(intervals_ms) or not intervals_ms.sum():
        return "one message so far"
    mean, spread = intervals_ms.mean(), intervals_ms.std()
    return f"{1000 / mean:.2f} a second, every {mean:.1f} ± {spread:.1f} ms"


def _draw_intervals(by_stamp: Floats, by_clock: Floats) -> Figure:
    figure = Figure(WIDTH, 360)
    top = max([1.0, *by_stamp, *by_clock])
    high = np.array([max(len(by_stamp), 2) - 1.0, top])
    axes = PlotAxes(figure, (70, 30, WIDTH - 90, 270), np.zeros(2), high)
    axes.draw("message", "interval (ms)")
    for values, color in ((by_clock, RED), (by_stamp, BLUE)):
        axes.curve(np.stack([np.arange(len(values)), values], axis=1), color)
    return figure


def _draw_share(taken: int, came: int) -> Figure:
    figure = Figure(WIDTH, 120)
    across = (WIDTH - 40) * taken / came
    figure.fill((20, 40, WIDTH - 40, 40), (235, 200, 195))
    figure.fill((20, 40, across, 40), GREEN)
    figure.text(20, 30, f"taken: {taken}", 14)
    figure.text(WIDTH - 20, 100, f"dropped: {came - taken}", 14, "end", RED)
    return figure


def _draw_graph() -> Figure:
    """The nodes of this lesson, and the topics between them."""
    takes = {step.declared.name: step.after or "picture" for step in LESSON.steps}
    published = {"source": "/image_raw", **{name: f"/{name}" for name in takes.values()}}
    takes = {"picture": "source", **takes}
    nodes = [DiagramNode("source", [], ["/image_raw"])]
    for name, before in takes.items():
        outputs = [published[name]] if name in published else []
        nodes.append(DiagramNode(name, [published[before]], outputs))
    layout = GraphLayout(nodes, WIDTH, _ROW, _CHARACTER)
    figure = Figure(WIDTH, round(layout.height))
    half = np.array([0, _BOX / 2])
    for above, below in layout.arrows:
        figure.arrow(layout.places[above] + half, layout.places[below] - half, GRAY, 1.5)
    for (kind, name), (x, y) in layout.places.items():
        width = layout.width_of(name)
        if kind == "node":
            box = (x - width / 2, y - _BOX / 2, width, _BOX)
            figure.fill(box, (240, 240, 240))
            figure.outline(box, INK, 1.2)
        figure.text(x, y + 5, name, 15, "middle", INK if kind == "node" else BLUE)
    return figure
