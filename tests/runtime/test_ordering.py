"""What waits to be recorded is counted, whatever it is: a slow disk costs no memory without end."""

from dataclasses import replace

import numpy as np
import pytest

from ros_visualise.data import (
    Header,
    Imu,
    OccupancyGrid,
    Odometry,
    PoseArray,
    Transforms,
    TransformStamped,
)
from ros_visualise.graph import Graph, place
from ros_visualise.nodes import node
from ros_visualise.runtime.ordering import Ordering
from ros_visualise.runtime.queues import Packet

TURN = np.array([0.0, 0, 0, 1])
ORIGIN = np.zeros(3)
MESSAGES = {
    "grid": (OccupancyGrid(np.zeros((100, 200), np.int8), 0.05, ORIGIN, TURN), 20_000),
    "poses": (PoseArray(np.zeros((500, 3)), np.tile(TURN, (500, 1))), 500 * 7 * 8),
    "imu": (Imu(TURN, ORIGIN, ORIGIN), 100),
    "odometry": (Odometry(ORIGIN, TURN), 100),
    "transforms": (
        Transforms(tuple(TransformStamped(str(i), ORIGIN, TURN, Header()) for i in range(50))),
        50 * 7 * 8,
    ),
}


@pytest.mark.parametrize("name", MESSAGES)
def test_every_kind_of_message_takes_what_its_data_do(name):
    message, least = MESSAGES[name]

    @node("taker", inputs={"data": type(message)}, outputs={"data": type(message)})
    def taker(data, params):
        return data

    graph = Graph(None, (place(taker.declared, {"data": "/in"}, {"data": "/out"}),))
    order = Ordering(graph, ["/out"])
    for number in range(10):
        order.put("/in", Packet(number, message, number))
        order.put("/out", Packet(number, message, number))
    assert 10 * least <= order.size <= 10 * (2 * least + 100_000)
    for _ in range(10):
        order.take("/out")
    assert order.size == 0


def naive_order(graph, topics, packets):
    """Numbers and topics in the order of `Ordering`, by its definition: all at the end."""
    place = {topic: at for at, topic in enumerate(topics)}
    wanted = [(p.number, place[t], t) for t, p in packets if t in place and p.message is not None]
    return [(number, topic) for number, _, topic in sorted(wanted)]


@pytest.mark.parametrize("seed", range(20))
def test_the_order_is_that_of_numbers_and_nodes_and_nothing_comes_too_late(seed):
    rng = np.random.default_rng(seed)
    message = MESSAGES["imu"][0]

    @node("taker", inputs={"data": Imu}, outputs={"data": Imu})
    def taker(data, params):
        return data

    topics = [f"/out{number}" for number in range(7)]
    places = [place(taker.declared, {"data": "/in"}, {"data": topic}) for topic in topics]
    graph = Graph(None, tuple(replace(one, name=f"n{at}") for at, one in enumerate(places)))
    streams = {"/in": [Packet(number, message, 0) for number in range(30)]}
    for topic in topics:
        there = rng.random(30) < 0.7
        streams[topic] = [Packet(n, message if there[n] else None, 0) for n in range(30)]
    order, taken, put = Ordering(graph, topics), [], []
    left = {topic: iter(packets) for topic, packets in streams.items()}
    while left:
        topic = rng.choice(sorted(left))
        packet = next(left[topic], None)
        if packet is None:
            del left[topic]
            order.finish(topic)
        else:
            order.put(topic, packet)
            put.append((topic, packet))
        while (first := order.first(at_once=False)) is not None:
            taken.append((order.take(first).number, first))
    assert taken == naive_order(graph, topics, put)
    assert order.ended
    assert order.size == 0
