"""What waits to be recorded is counted, whatever it is: a slow disk costs no memory without end."""

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
