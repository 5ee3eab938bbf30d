"""The contract of faults: in this process, and over a middleware of no ROS."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from contract_of_faults import *  # noqa: F403  # the tests themselves
from contract_of_faults import GARBAGE, GraphWorld, World, picture
from hub import Hub, HubMiddleware, run_one

from ros_visualise.data import Image, Text
from ros_visualise.graph.pipelines import alone
from ros_visualise.messages import type_name
from ros_visualise.messages.definitions import Definitions
from ros_visualise.messages.recorded import Recorded, TopicType
from ros_visualise.nodes import load
from ros_visualise.runtime.base import Subscription
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.runtime.queues import Packet
from ros_visualise.runtime.report import NodeReport

PATIENCE_S = 20.0


class LocalWorld:
    """The node in this process."""

    def __init__(self, own: Path) -> None:
        self._own = own
        self._start()

    def _start(self) -> None:
        self.runtime = LocalRuntime(alone(load(str(self._own), "picky")), None)
        self.runtime.start()

    def give(self, image: Any) -> None:
        self.runtime.publish("/picture", image)

    def give_damaged(self) -> None:
        self.give(Recorded(type_name(Image), GARBAGE, Definitions("cdr"), 0))

    def another(self) -> Callable[[int], object]:
        def give(number: int) -> None:
            thread = threading.Thread(target=self.give, args=(picture(number),))
            thread.start()
            thread.join()

        return give

    def intrude(self) -> None:
        self.give(Text("no image"))

    def subscribe(self, topic: str = "/answer") -> Subscription:
        return self.runtime.subscribe(topic, depth=100)

    def listen(self, take: Callable[[Image], object]) -> None:
        class Taker:
            def put(self, packet: Packet) -> None:
                if packet.message is not None:
                    take(packet.message)

            def close(self) -> None:
                """There is nothing to close."""

        self.runtime.topic("/answer").connect(Taker())

    def stall(self) -> None:
        self.subscribe()

    def restart(self, subscription: Subscription) -> Subscription:
        subscription.close()
        assert self.end() == 0
        self._start()
        return self.subscribe()

    def report(self) -> NodeReport:
        return self.runtime.report().nodes["picky"]

    def end(self) -> int:
        self.runtime.stop()
        return int(self.runtime.failed or self.runtime.report().is_incomplete)


class HubWorld(GraphWorld):
    """The node on a hub."""

    def __init__(self, own: Path) -> None:
        self._hub, self._own = Hub(), own
        self._free = threading.Event()
        super().__init__(HubMiddleware(self._hub, name="tests"))
        self._start()

    def _start(self) -> None:
        self._node = HubMiddleware(self._hub, args=[f"{self._own}:picky"])
        self._statuses: list[object] = []
        run = partial(run_one, "node", self._node, self._statuses)
        self._thread = threading.Thread(target=run)
        self._thread.start()
        self.wait()

    def give_damaged(self) -> None:
        for one in self._hub.topics["/picture"].subscribers:
            one.inbox.put(Packet(0, GARBAGE, time.monotonic_ns()))

    def another(self) -> Callable[[int], object]:
        other = HubMiddleware(self._hub, name="another")
        publisher = other.advertise("/picture", TopicType(type_name(Image)))
        return lambda number: publisher.publish(picture(number))

    def intrude(self) -> None:
        other = HubMiddleware(self._hub, name="intruder")
        other.advertise("/picture", TopicType(type_name(Text))).publish(Text("no image"))

    def stall(self) -> None:
        other = HubMiddleware(self._hub, name="deaf")
        wait = lambda _: self._free.wait(PATIENCE_S)  # noqa: E731
        other.subscribe("/answer", Image, wait, lambda _: None)

    def restart(self, subscription: Subscription) -> Subscription:
        assert self.end() == 0
        self.wait_until_gone()
        self._start()
        return subscription

    def end(self) -> int:
        self._node.end("the test is over")
        self._thread.join(PATIENCE_S)
        [status] = self._statuses
        assert isinstance(status, int)
        return status

    def close(self) -> None:
        self._free.set()
        self._node.end("the test is over")
        self._thread.join(PATIENCE_S)
        super().close()


@pytest.fixture(params=["local", "hub"])
def world(request: pytest.FixtureRequest, own: Path) -> Iterator[World]:
    if request.param == "local":
        local = LocalWorld(own)
        yield local
        local.end()
        return
    hub = HubWorld(own)
    yield hub
    hub.close()
