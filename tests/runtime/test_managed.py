"""A pipeline that a manager takes through the states of a managed node; no ROS is needed for it."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hub import Hub, HubTransport
from made_videos import numbered, write_video
from waiting import wait_for

from ros_visualise.core.errors import OpenError, RosVisualiseError, UsageError
from ros_visualise.data import Header, Image
from ros_visualise.messages.recorded import TopicType
from ros_visualise.running.executables.by_name import run
from ros_visualise.runtime.middleware import Managed

IMAGE = Image(np.zeros((4, 6), np.uint8), "mono8", Header(5, "camera"))

COUNTER = """
import numpy as np

from ros_visualise.data import Image
from ros_visualise.nodes import node


@node("counter", inputs={"image": Image}, outputs={"counted": Image})
class Counter:
    def __init__(self, params):
        self.count = 0

    def step(self, image, params):
        self.count += 1
        return Image(np.full((1, 1), self.count, np.uint16), "mono16", image.header)
"""


class Peer:
    """Another node, with images for the pipeline and an ear for what becomes of them."""

    def __init__(self, hub: Hub) -> None:
        self.transport = HubTransport(hub, name="peer")
        self.images = self.transport.advertise("/image_raw", TopicType(Image.type_name))
        self.heard: list[Image] = []

    def hear(self, topic: str) -> None:
        self.transport.subscribe(topic, Image, self.heard.append, pytest.fail)

    def counts(self) -> list[int]:
        return [int(one.pixels[0, 0]) for one in self.heard]

    def send(self, until: Callable[[], Any]) -> None:
        wait_for(lambda: self.images.publish(IMAGE) or until(), "an answer")


@contextmanager
def managed(hub: Hub, **given: Any) -> Iterator[Managed]:
    with hub.running("pipeline", managed=True, **given):
        yield wait_for(lambda: hub.managed.get("/pipeline"), "the node")


def is_open(path: Path) -> bool:
    """Whether this process holds a file open."""
    return any(
        os.path.realpath(link) == str(path.resolve()) for link in Path("/proc/self/fd").iterdir()
    )


@pytest.fixture
def hub() -> Hub:
    return Hub()


@pytest.fixture
def counter(tmp_path: Path) -> str:
    path = tmp_path / "own.py"
    path.write_text(COUNTER)
    return f"{path}:counter"


def test_it_takes_and_publishes_messages_only_while_it_is_active(hub: Hub, counter: str) -> None:
    peer = Peer(hub)
    with managed(hub, nodes=counter) as node:
        assert not {"/counter"} & set(dict(peer.transport.listing().publishers))
        node.configure()
        peer.hear("/counter")
        assert not peer.images.connections
        node.activate()
        peer.send(lambda: peer.heard)
        node.deactivate()
        assert not peer.images.connections
        last = peer.counts()[-1]
        peer.heard.clear()
        node.activate()
        peer.send(lambda: peer.heard)
        assert peer.counts()[0] > last  # what it knows stays
        node.deactivate()
        node.cleanup()
        assert "/counter" not in {t for t, nodes in peer.transport.listing().publishers if nodes}
        assert "/pipeline/counter" not in hub.parameters
        node.configure()
        node.activate()
        peer.heard.clear()
        peer.send(lambda: peer.heard)
        assert peer.counts()[0] < last + 2


def test_a_source_gives_nothing_while_it_is_not_active(hub: Hub, tmp_path: Path) -> None:
    video = write_video(tmp_path / "film.mp4", numbered(5, 64, 48))
    peer = Peer(hub)
    peer.hear("/image_raw")
    with managed(hub, source="streamer", streamer__path=str(video), streamer__loop=True) as node:
        node.configure()
        _, parameters = wait_for(lambda: hub.parameters.get("/pipeline/streamer"), "the source")
        parameters.update({"paused": True})
        parameters.update({"paused": False})
        assert not peer.heard
        node.activate()
        wait_for(lambda: len(peer.heard) > 7, "images")
        node.deactivate()
        parameters.update({"paused": True})
        parameters.update({"paused": False})
        came = len(peer.heard)
        node.activate()
        wait_for(lambda: len(peer.heard) > came, "more of them")
        del parameters  # they hold on to their source
        assert is_open(video)
        node.deactivate()
        node.cleanup()
        wait_for(lambda: not is_open(video), "the video to be closed")


def test_what_cannot_be_configured_is_said_and_can_be_tried_again(hub: Hub, tmp_path: Path) -> None:
    video = tmp_path / "film.mp4"
    with managed(hub, source="streamer", streamer__path=str(video)) as node:
        with pytest.raises(OpenError):
            node.configure()
        with pytest.raises(RosVisualiseError, match="not configured"):
            node.activate()
        write_video(video, numbered(3, 64, 48))
        node.configure()
        node.activate()


def test_a_manager_that_is_left_is_refused(hub: Hub) -> None:
    with managed(hub) as node:
        node.configure()
    with pytest.raises(RosVisualiseError, match="shutting down"):
        node.activate()


def test_managed_is_true_or_false(hub: Hub) -> None:
    host = hub.host({"managed": "perhaps"})
    with pytest.raises(SystemExit) as ended:
        run("pipeline", host)
    assert ended.value.code == UsageError.exit_status
