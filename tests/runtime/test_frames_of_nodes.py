"""Nodes that look up frames: which transforms they see, when, and what is dropped without them."""

import random
import time
from dataclasses import dataclass

import numpy as np
import pytest
from waiting import wait_for

from ros_visualise.core.errors import NoTransform
from ros_visualise.core.params import Parameters, param
from ros_visualise.data import Header, Image, PoseArray, Transforms, TransformStamped
from ros_visualise.graph import Graph, SourceNode, place
from ros_visualise.nodes import node, source
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.runtime.node_inputs import node_inputs
from ros_visualise.runtime.queues import Inbox, Packet
from ros_visualise.runtime.runner import NodeRunner
from ros_visualise.sources.playback import Playback

MS = 1_000_000
IMAGES = 30
TURN = np.array([0.0, 0, 0, 1])


def transform(parent, child, x, stamp_ns):
    at = np.array([x, 0.0, 0.0])
    return Transforms((TransformStamped(child, at, TURN, Header(stamp_ns, parent)),))


def image(stamp_ns):
    return Image(np.zeros((2, 2), np.uint8), "mono8", Header(stamp_ns, "camera"))


@dataclass(frozen=True)
class RobotParams:
    late_ms: int = param(30, "how much later than its stamp a transform comes", min=0, max=5000)
    until_ms: int = param(100_000, "when transforms end", min=0, max=100_000)


@source(
    "robot",
    params=RobotParams,
    outputs={"image": Image, "tf": Transforms, "tf_static": Transforms},
    latched=("tf_static",),
)
class Robot:
    """Moves at 1 m/s; images at 20 Hz, transforms at 50 Hz that come late."""

    def __init__(self, params, playback):
        self._params = params

    def messages(self):
        yield "tf_static", transform("base", "camera", 100.0, 0)
        late, end = self._params.late_ms, self._params.until_ms
        told = [(ms + late, "tf", ms) for ms in range(0, 50 * IMAGES, 20) if ms <= end]
        told += [(50 * number + 5, "image", 50 * number + 5) for number in range(IMAGES)]
        for _, port, ms in sorted(told):
            if port == "tf":
                yield port, transform("map", "base", ms / 1000, ms * MS)
            else:
                yield port, image(ms * MS)

    def close(self):
        pass


def locator(got, seed=None):
    choose = random.Random(seed)

    @node("locator", inputs={"image": Image}, outputs={"poses": PoseArray}, frames=True)
    def locate(image, params, frames):
        time.sleep(choose.random() / 200 if seed is not None else 0)
        stamp_ns = image.header.stamp_ns
        try:
            got.append((stamp_ns // MS, frames.lookup("map", "camera", stamp_ns)[0, 3]))
        except NoTransform:
            got.append((stamp_ns // MS, None))
            raise

    return locate


def graph_of(located, **settings):
    outputs = {"image": "/image_raw", "tf": "/tf", "tf_static": "/tf_static"}
    start = SourceNode("robot", Robot.declared, RobotParams(**settings), {}, outputs)
    placed = place(located.declared, {"image": "/image_raw"})
    return Graph(start, (placed,)).joined()


def run(graph):
    runtime = LocalRuntime(graph, Playback(rate=0))
    runtime.start()
    assert runtime.wait(60)
    runtime.stop()
    return runtime


def test_an_image_waits_for_the_transforms_of_its_time():
    got = []
    runtime = run(graph_of(locator(got)))
    assert not runtime.failed
    assert [ms for ms, _ in got] == list(range(5, 50 * IMAGES, 50))
    known = [(ms, x) for ms, x in got if x is not None]
    np.testing.assert_allclose([x for _, x in known], [100 + ms / 1000 for ms, _ in known])
    assert len(got) - len(known) <= 2  # the first, of before all transforms, and after the last
    dropped = runtime.report().nodes["locator"].dropped
    assert dropped.get("no transform", 0) == len(got) - len(known)


@pytest.mark.parametrize("settings", [{}, {"late_ms": 400}, {"late_ms": 700}, {"until_ms": 600}])
def test_lookups_do_not_depend_on_how_the_threads_run(settings):
    gots = []
    for seed in range(3):
        got = []
        run(graph_of(locator(got, seed), **settings))
        gots.append(got)
    assert gots[0] == gots[1] == gots[2]
    assert len(gots[0]) == IMAGES


def test_a_wait_is_bounded_and_what_cannot_be_located_is_counted_and_said_once(caplog):
    got = []
    runtime = run(graph_of(locator(got), until_ms=600))
    lost = [ms for ms, x in got if x is None and ms > 600]
    assert lost == list(range(605, 50 * IMAGES, 50))
    assert not runtime.failed
    said = [r.getMessage() for r in caplog.records if "no transform" in r.getMessage()]
    assert len(said) <= 2
    assert "locator: no transform from camera to map" in said[-1]


def test_live_an_image_waits_for_transforms_that_come_after_it():
    got = []

    @node("locator", inputs={"image": Image}, outputs={"poses": PoseArray}, frames=True)
    def locate(image, params, frames):
        got.append(frames.lookup("map", "base", image.header.stamp_ns)[0, 3])

    placed = place(locate.declared, {"image": "/image"})
    runtime = LocalRuntime(Graph(None, (placed,)).joined(), None)
    runtime.start()
    runtime.publish("/tf", transform("map", "base", 1.0, 1000 * MS))
    runtime.publish("/image", image(1010 * MS))
    runtime.publish("/tf", transform("map", "base", 2.0, 1020 * MS))
    wait_for(lambda: got == [1.5])
    runtime.publish("/image", image(1030 * MS))  # no transform of its time comes
    wait_for(lambda: runtime.report().nodes["locator"].dropped == {"no transform": 1})
    runtime.stop()


def test_transforms_that_are_none_are_counted_and_said(caplog):
    got = []
    placed = place(locator(got).declared, {"image": "/image"})
    runtime = LocalRuntime(Graph(None, (placed,)).joined(), None)
    runtime.start()
    runtime.publish("/tf", transform("map", "map", 1.0, 1000 * MS))
    wait_for(lambda: runtime.report().nodes["locator"].dropped == {"wrong tf": 1})
    runtime.stop()
    assert (
        "locator: /tf: 'map' -> 'map' is its own parent (further occurrences suppressed)"
        in caplog.text
    )


def test_faults_without_end_are_said_a_few_times_alone(caplog):
    placed = place(locator([]).declared, {"image": "/image"})
    runtime = LocalRuntime(Graph(None, (placed,)).joined(), None)
    runtime.start()
    for number in range(60):
        runtime.publish("/tf", transform(f"map{number}", f"map{number}", 1.0, 1000 * MS))
    wait_for(lambda: runtime.report().nodes["locator"].dropped == {"wrong tf": 60})
    runtime.stop()
    assert caplog.text.count("further occurrences suppressed") == 11
    assert caplog.text.count("locator: further warnings suppressed") == 1


def test_without_any_transforms_a_lookup_says_so():
    got = []
    outputs = {"image": "/image_raw", "tf": "/other", "tf_static": "/other_static"}
    start = SourceNode("robot", Robot.declared, RobotParams(), {}, outputs)
    graph = Graph(start, (place(locator(got).declared, {"image": "/image_raw"}),)).joined()
    runtime = run(graph)
    assert got == [(ms, None) for ms in range(5, 50 * IMAGES, 50)]
    assert runtime.report().nodes["locator"].dropped == {"no transform": IMAGES}


S = 1_000_000_000
NOW_NS = 1_500_000_000 * S  # by the clock of the recording, not by the process's


@node("seer", inputs={"image": Image}, outputs={}, frames=True)
def seer(image, params, frames):
    """Wants the frames of the image's time."""


class Waiting:
    """A node that waits for transforms, packet by packet."""

    def __init__(self, lossless):
        declared = place(seer.declared, {"image": "/image", "tf": "/tf"}, {})
        graph = Graph(None, (declared,))
        self.inputs = node_inputs(graph, NodeRunner(declared, Parameters(declared.params)))
        self.inbox = Inbox(lossless, depth=100)
        self.number = 0
        self.put("tf", transform("map", "base", 0.0, NOW_NS), -1.0)

    def put(self, port, message, at_s):
        """Something that came at this time, in seconds from now."""
        self.number += 1
        arrival_ns, log_ns = time.monotonic_ns() + round(at_s * S), NOW_NS + round(at_s * S)
        self.inbox.put(Packet(self.number, message, arrival_ns, port, log_ns))
        return self.asked()

    def asked(self):
        """How many images the node is asked about by now."""
        return sum(len(question.packets) for question in self.inputs.take(self.inbox, 0))


def test_an_image_that_waits_for_transforms_waits_no_longer_when_the_queues_turn_live():
    waiting = Waiting(lossless=True)
    assert waiting.put("image", image(NOW_NS + 10 * MS), -1.0) == 0
    waiting.inbox.lossless = False
    assert waiting.asked() == 1  # it came a second ago


def test_an_image_that_waits_for_transforms_waits_on_when_the_queues_turn_lossless():
    waiting = Waiting(lossless=False)
    assert waiting.put("image", image(NOW_NS + 10 * MS), 0.0) == 0
    waiting.inbox.lossless = True
    assert waiting.put("tf", transform("map", "base", 0.0, NOW_NS + 5 * MS), 0.1) == 0
    assert waiting.put("tf", transform("map", "base", 0.0, NOW_NS + 20 * MS), 0.2) == 1
