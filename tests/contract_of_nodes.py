"""What every runtime gives to a node of several inputs: sets by stamp, frames, calibrations.

Whoever imports this gives a fixture ``world``: a `World` in which the node `own` runs.

    from contract_of_nodes import *
"""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import pytest
from waiting import wait_for

from ros_visualise.data import (
    CameraInfo,
    Header,
    Image,
    PoseArray,
    PoseStamped,
    Transforms,
    TransformStamped,
)
from ros_visualise.messages.calibrations import info_topic
from ros_visualise.messages.qos import LATCHED, VOLATILE
from ros_visualise.messages.recorded import TopicType
from ros_visualise.runtime.middleware import Transport
from ros_visualise.runtime.remote.runtime import RemoteRuntime
from ros_visualise.runtime.topics import Subscription

STEP_NS = 40_000_000
TURN = np.array([0.0, 0, 0, 1])
FOCAL_PX = 123.0
INFO = info_topic("/picture")

LOCATOR = '''
from dataclasses import replace

import numpy as np

from ros_visualise.data import Image, PoseArray, PoseStamped
from ros_visualise.core.synchronizer import Exact
from ros_visualise.nodes import node


@node(
    "locator",
    inputs={"picture": Image, "found": PoseArray},
    outputs={"place": PoseStamped},
    sync=Exact(),
    frames=True,
    calibrated=True,
)
def locator(picture, found, params, frames):
    """Where the camera was when something was found, its focal length, and what was found."""
    header = picture.header
    T_map_camera = frames.lookup("map", "camera", header.stamp_ns)
    info = picture.camera_info
    told = [T_map_camera[0, 3], info.K[0, 0] if info else -1, found.positions_xyz[0, 0]]
    return PoseStamped(np.array(told), np.array([0, 0, 0, 1.0]), header)
'''


def transform(parent: str, child: str, x: float, stamp_ns: int) -> Transforms:
    at = np.array([x, 0.0, 0.0])
    return Transforms((TransformStamped(child, at, TURN, Header(stamp_ns, parent)),))


class World(Protocol):
    """The node, and the topics around it."""

    def give(self, topic: str, message: Any) -> None:
        """Publish a message."""

    def give_image(self, image: Image, info: CameraInfo | None) -> None:
        """Publish an image of a camera whose calibration this is."""

    def subscribe(self) -> Subscription:
        """Listen to the node's answers."""


class GraphWorld:
    """The node runs elsewhere on a graph; calibrations come on their own topic.

    Args:
        transport: of another node of the graph.
    """

    def __init__(self, transport: Transport) -> None:
        kinds = {"/picture": Image, "/found": PoseArray, "/tf": Transforms}
        kinds |= {"/tf_static": Transforms, INFO: CameraInfo}
        self._publishers = {
            topic: transport.advertise(
                topic,
                TopicType(kind.type_name, qos=LATCHED if topic == "/tf_static" else VOLATILE),
            )
            for topic, kind in kinds.items()
        }
        self._remote = RemoteRuntime(transport)

    def give(self, topic: str, message: Any) -> None:
        self._publishers[topic].publish(message)

    def give_image(self, image: Image, info: CameraInfo | None) -> None:
        self.give("/picture", image)
        if info is not None:
            self.give(INFO, replace(info, header=image.header))

    def wait(self) -> None:
        """Wait until the node listens, and can be listened to."""
        for publisher in self._publishers.values():
            wait_for(lambda p=publisher: p.connections, publisher.name)
        wait_for(lambda: "/locator" in self._remote.graph.topics, "/locator")

    def subscribe(self) -> Subscription:
        return self._remote.subscribe("/locator", depth=100)

    def close(self) -> None:
        self._remote.close()
        for publisher in self._publishers.values():
            publisher.close()


@pytest.fixture
def own(tmp_path: Path) -> Path:
    """The file with the node ``locator``."""
    path = tmp_path / "own.py"
    path.write_text(LOCATOR)
    return path


def places(world: World, info: CameraInfo | None, count: int) -> list[PoseStamped]:
    """The first answers, while images come, and something is found in every other one."""
    subscription = world.subscribe()
    world.give("/tf_static", transform("base", "camera", 1000.0, 0))
    found: list[PoseStamped] = []
    numbers = itertools.count(25)

    def enough() -> bool:
        number = next(numbers)
        stamp_ns = number * STEP_NS
        image = Image(np.zeros((4, 6), np.uint8), "mono8", Header(stamp_ns, "camera"))
        world.give_image(image, info)
        if number % 2 == 0:
            boxes = PoseArray(np.array([[number, 0.0, 0.0]]), TURN[None], image.header)
            world.give("/found", boxes)
        at_ns = stamp_ns + STEP_NS // 2
        world.give("/tf", transform("map", "base", at_ns / 1e9, at_ns))
        while (place := subscription.take(0.02)) is not None:
            found.append(place)
        return len(found) >= count

    wait_for(enough, "answers")
    subscription.close()
    return found


def test_sets_come_by_stamp_with_the_frames_of_their_time_and_the_calibration(world: World):
    info = CameraInfo(4, 6, K=np.diag([FOCAL_PX, FOCAL_PX, 1.0]))
    found = places(world, info, 10)
    for place in found:
        x, focal_px, number = place.position_xyz
        stamp_ns = place.header.stamp_ns
        assert stamp_ns == number * STEP_NS
        assert number % 2 == 0
        assert x == pytest.approx(1000 + stamp_ns / 1e9)
        assert focal_px == FOCAL_PX


def test_without_a_calibration_it_goes_on(world: World):
    found = places(world, None, 3)
    assert {place.position_xyz[1] for place in found} == {-1}
