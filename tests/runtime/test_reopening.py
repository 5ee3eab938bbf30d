"""What is set while a source is opened anew, which may take long."""

import threading
from dataclasses import dataclass

import numpy as np
import pytest
from test_local import PERIOD_NS
from waiting import wait_for

from ros_visualise.core.errors import OpenError, ParameterError
from ros_visualise.core.params import param
from ros_visualise.data import Header, Image
from ros_visualise.graph import Graph, SourceNode
from ros_visualise.nodes import source
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sources.playback import Playback

PATIENCE_S = 20.0


@dataclass(frozen=True)
class SlowParams:
    path: str = param("first", "what is opened; missing cannot be", restart=True)
    gain: int = param(1, "value of all pixels; the new device takes up to 100")


class Slow:
    """A source that takes its time to open all but its first path."""

    opened: list[tuple[str, int]]

    def __init__(self, params, playback):
        if params.path != "first":
            self.opening.set()
            assert self.go_on.wait(PATIENCE_S)
        if params.path == "missing":
            raise OpenError("missing: no such device")
        self.opened.append((params.path, params.gain))
        self.params, self.playback = params, playback

    def configure(self, params, changed):
        if params.gain > 100 and self.params.path == "second":
            raise ParameterError(f"gain={params.gain}: the device takes up to 100")
        self.params = params

    def messages(self):
        for stamp_ns, _ in self.playback.run(self):
            yield (
                "image",
                Image(np.full((1, 1), self.params.gain, np.uint8), "mono8", Header(stamp_ns)),
            )

    duration_ns = 10_000 * PERIOD_NS

    def read(self, start_ns):
        for number in range(start_ns // PERIOD_NS, 10_000):
            yield number * PERIOD_NS, number

    def close(self):
        pass


@pytest.fixture(params=[False, True], ids=["file", "device"])
def reopened(request):
    """A running source that is opening its second path."""
    members = {"opening": threading.Event(), "go_on": threading.Event(), "opened": []}
    kind = type("OwnSlow", (Slow,), members)
    declared = source("slow", params=SlowParams, outputs={"image": Image}, live=request.param)(kind)
    node = SourceNode("slow", declared.declared, SlowParams(), {}, {"image": "/image"})
    made = LocalRuntime(Graph(node, ()), Playback())
    made.kind, made.set = kind, made.parameters["slow"].update
    made.start()
    yield made
    kind.go_on.set()
    made.stop()
    assert not made.failed


def gain_of(runtime):
    """The newest image's."""
    subscription = runtime.subscribe("/image")
    image = subscription.take(1)
    subscription.close()
    return None if image is None else int(image.pixels[0, 0])


def open_second(runtime, path="second"):
    runtime.set({"path": path})
    assert runtime.kind.opening.wait(PATIENCE_S)


def test_a_parameter_that_is_set_while_the_source_opens_holds_afterwards(reopened):
    open_second(reopened)
    reopened.set({"gain": 7})
    reopened.kind.go_on.set()
    wait_for(lambda: gain_of(reopened) == 7)
    assert reopened.kind.opened == [("first", 1), ("second", 1)]


def test_another_path_that_is_set_while_the_source_opens_is_opened_next(reopened):
    open_second(reopened)
    reopened.set({"path": "third", "gain": 7})
    reopened.kind.go_on.set()
    wait_for(lambda: gain_of(reopened) == 7)
    assert reopened.kind.opened[-1] == ("third", 7)
    assert reopened.parameters["slow"].current == SlowParams("third", 7)


def test_a_path_that_is_set_while_another_cannot_be_opened_stays(reopened, caplog):
    open_second(reopened, "missing")
    reopened.set({"path": "third"})
    reopened.kind.go_on.set()
    wait_for(lambda: ("third", 1) in reopened.kind.opened)
    assert reopened.parameters["slow"].current.path == "third"
    assert caplog.messages == ["missing: no such device"]


def test_what_is_set_while_a_path_cannot_be_opened_holds_with_the_one_before(reopened, caplog):
    open_second(reopened, "missing")
    reopened.set({"gain": 7})
    reopened.kind.go_on.set()
    wait_for(lambda: gain_of(reopened) == 7)
    assert reopened.parameters["slow"].current == SlowParams("first", 7)
    assert caplog.messages == ["missing: no such device"]


def test_what_the_opened_source_refuses_is_said_and_set_back(reopened, caplog):
    open_second(reopened)
    reopened.set({"gain": 200})
    reopened.kind.go_on.set()
    wait_for(lambda: reopened.parameters["slow"].current == SlowParams("second", 1))
    wait_for(lambda: gain_of(reopened) == 1)
    assert caplog.messages == ["gain=200: the device takes up to 100"]
