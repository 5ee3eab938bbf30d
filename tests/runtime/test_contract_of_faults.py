"""The contract of faults: local, a transport for tests, and Zenoh."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from functools import partial
from pathlib import Path
from typing import Any

import pytest
import zenoh
from contract_of_faults import *  # noqa: F403  # the tests themselves
from contract_of_faults import GARBAGE, ThreadWorld, World, picture
from hub import Hub, HubTransport
from waiting import wait_for
from zenoh_net import ZenohNet, zenoh_net

from ros_visualise.data import Image, Text
from ros_visualise.graph.pipelines import alone
from ros_visualise.messages.definitions import Definitions
from ros_visualise.messages.recorded import Recorded, TopicType
from ros_visualise.nodes import load
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.runtime.queues import Packet
from ros_visualise.runtime.report import NodeReport
from ros_visualise.runtime.topics import Subscription
from ros_visualise.runtime.zenoh import keys
from ros_visualise.sinks.encoding import Encoder


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
        self.give(Recorded(Image.type_name, GARBAGE, Definitions("cdr"), 0))

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


class HubWorld(ThreadWorld):
    """The node on a hub."""

    def __init__(self, own: Path) -> None:
        self._hub = Hub()
        super().__init__(own, partial(HubTransport, self._hub))

    def give_damaged(self) -> None:
        for one in self._hub.topics["/picture"].subscribers:
            one.inbox.put(Packet(0, GARBAGE, time.monotonic_ns()))


class ZenohWorld(ThreadWorld):
    """The node on a Zenoh network."""

    def __init__(self, own: Path, net: ZenohNet) -> None:
        self._address = net.address
        super().__init__(own, net.join)

    def give_damaged(self) -> None:
        declared = Encoder("cdr").declare(TopicType(Image.type_name))
        key = keys.topic_key("/picture", declared.name, declared.digest)
        config = {"mode": "client", "connect": {"endpoints": [self._address]}}
        with zenoh.open(zenoh.Config.from_json5(json.dumps(config))) as stock:
            publisher = stock.declare_publisher(key)
            wait_for(lambda: publisher.matching_status, "the node")
            publisher.put(GARBAGE)


@pytest.fixture(params=["local", "hub", "zenoh"])
def world(request: pytest.FixtureRequest, own: Path) -> Iterator[World]:
    if request.param == "local":
        local = LocalWorld(own)
        yield local
        local.end()
        return
    with ExitStack() as stack:
        if request.param == "zenoh":
            made: ThreadWorld = ZenohWorld(own, stack.enter_context(zenoh_net()))
        else:
            made = HubWorld(own)
        yield stack.enter_context(closing(made))
