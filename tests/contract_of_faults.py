"""What every runtime does when something goes wrong: it costs itself alone, and is counted.

Whoever imports this gives a fixture ``world``: a `World` in which the node `own` runs.

    from contract_of_faults import *
"""

from __future__ import annotations

import itertools
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import pytest
from hosts import PATIENCE_S, GivenHost, Running
from waiting import wait_for

from ros_visualise.core.errors import DamagedMessage, RosVisualiseError, Unreachable, UsageError
from ros_visualise.core.supervision import PROCESS
from ros_visualise.data import Header, Image, Text
from ros_visualise.messages.recorded import TopicType
from ros_visualise.runtime.middleware import Transport
from ros_visualise.runtime.remote.runtime import RemoteRuntime
from ros_visualise.runtime.report import NodeReport
from ros_visualise.runtime.topics import Subscription

BAD, FOREIGN = 13, 66
SEVERAL = 50  # more than is on its way
GARBAGE = b"\x07\x00\x00\x00what is this"

PICKY = f'''
from dataclasses import replace

import numpy as np

from ros_visualise.data import Header, Image, PoseStamped
from ros_visualise.nodes import node


@node(
    "picky",
    inputs={{"picture": Image}},
    outputs={{"answer": Image, "last": PoseStamped}},
    latched=("last",),
)
def picky(picture, params):
    """Answers with the image, but for some, and tells its number."""
    number = int(picture.pixels[0, 0])
    if number == {BAD}:
        raise ValueError("a number that it cannot stand")
    if number == {FOREIGN}:
        return {{"answer": replace(picture, header=Header(-(10**18), "before there was ROS"))}}
    place = np.array([number, 0.0, 0.0]), np.array([0.0, 0, 0, 1])
    return {{"answer": picture, "last": PoseStamped(*place, picture.header)}}
'''


def picture(number: int, shape: tuple[int, int] = (4, 6)) -> Image:
    return Image(np.full(shape, number, np.uint8), "mono8", Header(number + 1, "camera"))


def number_of(image: Image) -> int:
    return int(image.pixels[0, 0])


class World(Protocol):
    """The node ``picky``, and the topics around it."""

    def give(self, image: Image) -> None:
        """Publish an image on its input."""

    def give_damaged(self) -> None:
        """Publish what is no image, as if it were one."""

    def another(self) -> Callable[[int], object]:
        """Somebody else who publishes images on its input: gives the image of that number."""

    def intrude(self) -> None:
        """Somebody else publishes messages of another type on its input, from now on."""

    def subscribe(self, topic: str = "/answer") -> Subscription:
        """Listen to the node's answers."""

    def listen(self, take: Callable[[Image], object]) -> None:
        """Have this called with the answers, at the end of the delivery."""

    def stall(self) -> None:
        """Somebody else listens to the answers, and takes none."""

    def restart(self, subscription: Subscription) -> Subscription:
        """End the node and begin it anew; the subscription that holds then."""

    def report(self) -> NodeReport:
        """What the node has done by now."""

    def end(self) -> int:
        """End the node; the exit status of its process."""


class GraphWorld:
    """The node runs elsewhere on a graph.

    Args:
        transport: of another node of the graph.
    """

    def __init__(self, transport: Transport) -> None:
        self.transport = transport
        self.pictures = transport.advertise("/picture", TopicType(Image.type_name))
        self._remote = RemoteRuntime(transport)
        self._listening: list[Any] = []

    def give(self, image: Image) -> None:
        self.pictures.publish(image)

    def subscribe(self, topic: str = "/answer") -> Subscription:
        return self._remote.subscribe(topic, depth=100)

    def listen(self, take: Callable[[Image], object]) -> None:
        self._listening.append(
            self.transport.subscribe("/answer", Image, take, lambda _: None)  # type: ignore[arg-type]
        )

    def report(self) -> NodeReport:
        return self._remote.report(2.0).nodes.get("picky", NodeReport())

    def wait(self) -> None:
        """Wait until the node listens, and can be listened to."""
        wait_for(lambda: self.pictures.connections, "the node")
        wait_for(lambda: "/answer" in self._remote.graph.topics, "/answer")

    def wait_until_gone(self) -> None:
        """Wait until the node listens no more."""
        wait_for(lambda: not self.pictures.connections, "the end of the node")

    def close(self) -> None:
        for one in self._listening:
            one.close()
        self._remote.close()
        self.pictures.close()


class ThreadWorld(GraphWorld):
    """The node as a thread of this process, on a transport that several nodes here can join.

    Args:
        own: the file with the node.
        join: opens the transport of a node of this name.
    """

    def __init__(self, own: Path, join: Callable[[str], Transport]) -> None:
        self._own, self._join = own, join
        self._free = threading.Event()
        self._others: list[Transport] = []
        super().__init__(join("tests"))
        self._start()

    def _start(self) -> None:
        self._node = Running("node", GivenHost(self._join, args=[f"{self._own}:picky"]))
        self.wait()

    def another(self) -> Callable[[int], object]:
        publisher = self._other("another").advertise("/picture", TopicType(Image.type_name))
        return lambda number: publisher.publish(picture(number))

    def intrude(self) -> None:
        publisher = self._other("intruder").advertise("/picture", TopicType(Text.type_name))
        publisher.publish(Text("no image"))

    def stall(self) -> None:
        wait = lambda _: self._free.wait(PATIENCE_S)  # noqa: E731
        self._other("deaf").subscribe("/answer", Image, wait, lambda _: None)

    def _other(self, name: str) -> Transport:
        self._others.append(self._join(name))
        return self._others[-1]

    def restart(self, subscription: Subscription) -> Subscription:
        assert self.end() == 0
        self.wait_until_gone()
        self._start()
        return subscription

    def end(self) -> int:
        return self._node.end()

    def close(self) -> None:
        self._free.set()
        self._node.end()
        super().close()
        for one in (*self._others, self.transport):
            one.close()


@pytest.fixture
def own(tmp_path: Path) -> Path:
    """The file with the node ``picky``."""
    path = tmp_path / "own.py"
    path.write_text(PICKY)
    return path


def answers(
    world: World,
    subscription: Subscription,
    number: int,
    give: Callable[[int], object] | None = None,
) -> list[int]:
    """The answers until the one to this image, which is given until it comes."""
    found: list[int] = []

    def has_come() -> bool:
        if give is None:
            world.give(picture(number))
        else:
            give(number)
        while (image := subscription.take(0.05)) is not None:
            found.append(number_of(image))
        return number in found

    wait_for(has_come, f"the answer to {number}")
    return found


def give_until(world: World, number: int, condition: Callable[[NodeReport], object]) -> None:
    """Give an image over and over, as one may be dropped for another, until the report says so."""

    def has_come() -> object:
        world.give(picture(number))
        return condition(world.report())

    wait_for(has_come, f"the report of {number}")


def failures() -> dict[str, int]:
    """How what failed -> how often; forgotten by that."""
    found = {failure.kind: count for failure, count in PROCESS.failures.items()}
    PROCESS.forget()
    return found


def test_all_is_well_where_nothing_fails(world: World):
    answers(world, world.subscribe(), 1)
    assert world.end() == 0


def test_a_step_that_raises_costs_its_message_alone(world: World):
    subscription = world.subscribe()
    answers(world, subscription, 1)
    give_until(world, BAD, lambda report: report.dropped.get("error"))
    assert BAD not in answers(world, subscription, 2)
    assert world.end() == 1


def test_what_cannot_be_decoded_costs_itself_alone(world: World):
    subscription = world.subscribe()
    answers(world, subscription, 1)

    def is_counted() -> object:
        world.give_damaged()  # again and again: one may be dropped for another
        return world.report().dropped.get("damaged")

    wait_for(is_counted, "the count")
    answers(world, subscription, 2)


def test_what_cannot_be_published_costs_itself_alone(world: World):
    subscription = world.subscribe()
    answers(world, subscription, 1)
    processed = world.report().processed
    give_until(world, FOREIGN, lambda report: report.processed > processed + SEVERAL)
    seen = answers(world, subscription, 2)
    is_graph = isinstance(world, GraphWorld)  # within a process any stamp passes
    assert (FOREIGN in seen) is not is_graph
    assert world.end() == is_graph
    if is_graph:
        with pytest.raises(DamagedMessage):
            world.give(Image(np.zeros((1, 1), np.uint8), "mono8", Header(-(10**18))))


def test_a_listener_that_raises_costs_itself_alone(world: World):
    asked = []

    def refuse(image: Image) -> None:
        asked.append(number_of(image))
        raise ValueError("not mine")

    subscription = world.subscribe()
    world.listen(refuse)
    for number in (1, 2, 3):
        answers(world, subscription, number)
    wait_for(lambda: 3 in asked, "all of them")
    found = failures()
    assert found.keys() == {"ValueError"}
    assert found["ValueError"] >= 3


def test_a_listener_that_takes_nothing_holds_up_nobody_else(world: World):
    subscription = world.subscribe()
    world.stall()
    answers(world, subscription, 1)
    for number in range(100, 120):
        world.give(picture(number, (1000, 1000)))  # more than queues and sockets hold
    answers(world, subscription, 2)


def test_two_may_publish(world: World):
    subscription = world.subscribe()
    answers(world, subscription, 1)
    answers(world, subscription, 7, world.another())
    answers(world, subscription, 8)


def test_messages_of_another_type_disturb_nobody(world: World):
    subscription = world.subscribe()
    answers(world, subscription, 1)
    world.intrude()
    for number in (2, 3):
        answers(world, subscription, number)


def test_a_type_that_nobody_knows_is_refused(world: World):
    if isinstance(world, GraphWorld):
        with pytest.raises((UsageError, DamagedMessage), match="no_such_msgs/msg/Thing"):
            world.transport.advertise("/thing", TopicType("no_such_msgs/msg/Thing"))
    answers(world, world.subscribe(), 1)


def test_who_is_asked_and_is_not_there_is_unreachable(world: World):
    if isinstance(world, GraphWorld):
        with pytest.raises(Unreachable, match="/nobody/act"):
            world.transport.call("/nobody/act")
        parameters = world.transport.follow_parameters("/nobody", Anyone())
        assert not parameters.connected
        with pytest.raises(Unreachable):
            parameters.set({"low": 1})
        parameters.close()


def test_a_refused_action_is_an_error_with_its_reason(world: World):
    if isinstance(world, GraphWorld):
        offered = world.transport.offer("~refused", refuse)
        name = f"{world.transport.resolve('~')}/refused"
        wait_for(lambda: "not today" in failure(world.transport, name), "the reason")
        offered.close()


def test_what_is_closed_can_be_used_all_the_same(world: World):
    """It does nothing, or raises an error of ours."""
    if isinstance(world, GraphWorld):
        publisher = world.transport.advertise("/closed", TopicType(Image.type_name))
        heard = world.transport.subscribe("/closed", Image, lambda _: None, lambda _: None)
        for one in (publisher, heard, publisher, heard):
            one.close()
        publisher.publish(picture(1))
        publisher.flush(0.1)
        publisher.wait_for_room(0.1)
        assert publisher.connections == 0


class Anyone:
    """Takes whatever parameters come."""

    def declared(self, params: type, node: object) -> None:
        """It is taken."""

    def updated(self, values: object) -> None:
        """It is taken."""


def refuse() -> None:
    raise UsageError("not today")


def failure(transport: Transport, action: str) -> str:
    """The text of the error by which an action is answered; as long as there is none, no text."""
    try:
        transport.call(action)
    except Unreachable:
        return ""
    except RosVisualiseError as error:
        return str(error)
    pytest.fail("it was not refused")


def test_who_comes_late_is_served_from_then_on(world: World):
    answers(world, world.subscribe(), 1)
    late, last = world.subscribe(), world.subscribe("/last")
    assert wait_for(lambda: last.take(0.1), "what was latched").position_xyz[0] == 1
    assert set(answers(world, late, 2)) <= {1, 2}


def test_a_node_that_is_started_again_is_heard_again(world: World):
    subscription = world.subscribe()
    for number in itertools.islice(itertools.count(1), 2):
        answers(world, subscription, number)
        subscription = world.restart(subscription)
    answers(world, subscription, 9)
    assert world.end() == 0
