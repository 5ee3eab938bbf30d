"""The contract of nodes with several inputs: local, a transport for tests, and Zenoh."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from contract_of_nodes import *  # noqa: F403  # the tests themselves
from contract_of_nodes import GraphWorld, World
from hosts import GivenHost, running
from hub import Hub, HubTransport
from zenoh_net import zenoh_net

from ros_visualise.data import CameraInfo, Image
from ros_visualise.graph.pipelines import alone
from ros_visualise.nodes import load
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.runtime.middleware import Transport
from ros_visualise.runtime.topics import Subscription


class LocalWorld:
    """The node in this process; its images have their calibration as those of sources do."""

    def __init__(self, own: Path) -> None:
        self.runtime = LocalRuntime(alone(load(str(own), "locator")), None)

    def give(self, topic: str, message: Any) -> None:
        self.runtime.publish(topic, message)

    def give_image(self, image: Image, info: CameraInfo | None) -> None:
        self.give("/picture", replace(image, camera_info=info))

    def subscribe(self) -> Subscription:
        return self.runtime.subscribe("/locator", depth=100)


@pytest.fixture(params=["local", "hub", "zenoh"])
def world(request: pytest.FixtureRequest, own: Path) -> Iterator[World]:
    if request.param == "local":
        made = LocalWorld(own)
        made.runtime.start()
        yield made
        made.runtime.stop()
        return
    with ExitStack() as stack:
        if request.param == "zenoh":
            join: Callable[[str], Transport] = stack.enter_context(zenoh_net()).join
        else:
            join = partial(HubTransport, Hub())
        stack.enter_context(running("node", GivenHost(join, args=[f"{own}:locator"])))
        transport = join("tests")
        stack.callback(transport.close)
        graph = stack.enter_context(closing(GraphWorld(transport)))
        graph.wait()
        yield graph
